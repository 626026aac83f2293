import pytest
import torch

from sidegan.gan import diversity as terms
from sidegan.gan.diversity import Spread, distance_target, rank_target
from sidegan.gan.terms import Batch
from sidegan.gan.training import random_trajectories
from tests.gan.conftest import random


@pytest.fixture(scope="module")
def spread(seeds):
    return diversity(Spread(1.0, seeds))


@pytest.fixture(scope="module")
def distance(seeds):
    return diversity(terms.distance(1.0, distance_target(seeds, random=False)))


def diversity(term):
    """The loss of coefficients."""
    return lambda c: term(Batch(c, lambda: c, None))


def test_the_seeds_themselves_lose_nothing(seeds, spread, distance):
    assert abs(float(spread(seeds.float()))) < 1e-3
    assert float(distance(seeds.float())) == 0


@pytest.mark.parametrize("name", ["spread", "distance"])
def test_a_shrunken_batch_is_pushed_apart(seeds, name, request):
    loss = request.getfixturevalue(name)
    c = (seeds.mean(0) + 0.3 * (seeds - seeds.mean(0))).float().requires_grad_(True)
    value = loss(c)
    assert value > 0.1
    (slope,) = torch.autograd.grad(value, c)
    better = c.detach() - 0.1 * slope / slope.norm()
    assert loss(better) < value
    assert torch.pdist(better.flatten(1)).mean() > torch.pdist(c.detach().flatten(1)).mean()


def test_a_batch_that_spreads_too_far_loses_spread_but_no_distance(seeds, spread, distance):
    assert spread(2 * seeds.float()) > 0.1
    assert distance(2 * seeds.float()) == 0


def test_one_lost_direction_is_seen_by_the_spread(seeds, spread, distance):
    """The mean distance hardly changes, the covariance does."""
    x = seeds.flatten(1)
    _, vectors = torch.linalg.eigh(torch.cov(x.T))
    weak = vectors[:, 0]
    flat = (x - (x @ weak)[:, None] * weak).view_as(seeds).float()
    assert distance(flat) == 0
    assert spread(flat) > 0.1


def test_a_collapsed_batch_gives_a_finite_slope(seeds, spread, distance):
    noise = 1e-6 * torch.randn(20, *seeds.shape[1:], generator=random())
    c = (seeds[:1].float() + noise).requires_grad_(True)
    value = spread(c) + distance(c)
    (slope,) = torch.autograd.grad(value, c)
    assert torch.isfinite(value) and torch.isfinite(slope).all() and slope.abs().max() > 0


def test_rank_is_missed_by_a_batch_with_few_directions(constraints, family):
    c = random_trajectories(constraints, family, 0).float()
    loss = diversity(terms.rank(1.0, rank_target(c, 100)))
    assert loss(c[:100]) < 0.1
    vectors = torch.randn(2, c[0].numel(), generator=random())
    flat = (torch.randn(100, 2, generator=random()) @ vectors).view(100, *c.shape[1:]).requires_grad_(True)
    value = loss(flat)
    (slope,) = torch.autograd.grad(value, flat)
    assert value > 1 and torch.isfinite(slope).all()
    assert loss(flat.detach() - 0.5 * slope / slope.norm()) < value
