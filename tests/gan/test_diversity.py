import torch

from sidegan.gan.diversity import Diversity
from tests.gan.conftest import random


def test_the_seeds_themselves_lose_nothing(seeds):
    losses = Diversity(seeds)
    c = seeds.float()
    assert abs(float(losses.spread_loss(c))) < 1e-3
    assert float(losses.distance_loss(c)) == 0


def test_a_shrunken_batch_is_pushed_apart(seeds):
    losses = Diversity(seeds)
    c = (seeds.mean(0) + 0.3 * (seeds - seeds.mean(0))).float().requires_grad_(True)
    for loss in (losses.spread_loss, losses.distance_loss):
        value = loss(c)
        assert value > 0.1
        (slope,) = torch.autograd.grad(value, c)
        better = c.detach() - 0.1 * slope / slope.norm()
        assert loss(better) < value
        assert torch.pdist(better.flatten(1)).mean() > torch.pdist(c.detach().flatten(1)).mean()


def test_a_batch_that_spreads_too_far_loses_spread_but_no_distance(seeds):
    losses = Diversity(seeds)
    c = 2 * seeds.float()
    assert losses.spread_loss(c) > 0.1
    assert losses.distance_loss(c) == 0


def test_one_lost_direction_is_seen_by_the_spread(seeds):
    """The mean distance hardly changes, the covariance does."""
    losses = Diversity(seeds)
    x = seeds.flatten(1)
    _, vectors = torch.linalg.eigh(torch.cov(x.T))
    weak = vectors[:, 0]
    flat = (x - (x @ weak)[:, None] * weak).view_as(seeds).float()
    assert losses.distance_loss(flat) == 0
    assert losses.spread_loss(flat) > 0.1


def test_a_collapsed_batch_gives_a_finite_slope(seeds):
    losses = Diversity(seeds)
    noise = 1e-6 * torch.randn(20, *seeds.shape[1:], generator=random())
    c = (seeds[:1].float() + noise).requires_grad_(True)
    value = losses.spread_loss(c) + losses.distance_loss(c)
    (slope,) = torch.autograd.grad(value, c)
    assert torch.isfinite(value) and torch.isfinite(slope).all() and slope.abs().max() > 0
