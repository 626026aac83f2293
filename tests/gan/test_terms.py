"""Loss terms by closed forms, and by what one step of the generator on each of them changes."""

from dataclasses import replace

import pytest
import torch

from sidegan.gan import diversity
from sidegan.gan.diversity import distance_target, rank_target
from sidegan.gan.loop import Training
from sidegan.gan.terms import Adversary, Batch, LossTerm
from sidegan.gan.training import random_trajectories
from tests.gan.conftest import ADVERSARIAL, FULL, NONE, random


@pytest.fixture
def weighed(assembled, full, predictor, converter):
    """An untrained variant with the given weights."""
    return lambda weights, **settings: assembled(
        replace(full, weights=weights, **settings), predictor, converter
    )


def critics(training):
    """Networks of the discriminators."""
    return [term.network for term in training.terms if isinstance(term, Adversary)]


def stepped(training, measure, size=0.05):
    """What ``measure`` makes of the same noise before and after one gradient step of the generator."""

    def now():
        with torch.no_grad():
            return float(measure(training.sampler(200, random(1)).coefficients))

    before, network = now(), training.sampler.network
    training.generator_loss(500).backward()
    norm = torch.stack([p.grad.norm() for p in network.parameters()]).norm()
    with torch.no_grad():
        for p in network.parameters():
            p -= size * p.grad / norm
    return before, now()


def log_ratios(converter, c):
    logs = converter.log_features(converter(c))
    return logs.amax(1) - logs.amin(1)


def test_a_step_on_each_loss_improves_what_it_is_about(weighed, predictor, converter):
    def seen(number, view):
        return lambda c: critics(training)[number](view(c)).mean()

    measures = {
        "success": lambda c: predictor(c).mean(),
        "fitness": lambda c: -log_ratios(converter, c).mean(),
        "adversarial": seen(0, lambda c: training.sampler.scaling.image(c)),
        "features": seen(1, converter),
        "distance": lambda c: torch.pdist(c.flatten(1)).mean(),
    }
    for name, measure in measures.items():
        training = weighed(replace(NONE, **{name: 1}), fitness_start=0)
        with torch.no_grad():
            training.sampler.network.shortcut.weight *= 0.3 if name == "distance" else 1
        before, after = stepped(training, measure)
        assert after > before, name


def test_losses_are_their_closed_forms(weighed, predictor, converter):
    training = weighed(FULL, fitness_start=0)
    batch, (first, second) = training.sampler(32), critics(training)
    c = batch.coefficients
    expected = [
        -torch.log(first(batch.images).sigmoid()).mean(),  # D1
        -predictor(c).mean(),
        -torch.log(second(converter(c)).sigmoid()).mean(),  # D2
        log_ratios(converter, c).mean(),
    ]
    for term, value in zip(training.parts, expected):
        torch.testing.assert_close(term(batch), value)


def test_fitness_counts_from_its_first_epoch_on(weighed, monkeypatch):
    losses = {}
    for epoch in (0, 1, 2):
        monkeypatch.setattr(Training, "current_epoch", epoch)
        for fitness in (0, 1):
            training = weighed(replace(ADVERSARIAL, fitness=fitness), fitness_start=1)
            torch.manual_seed(2)
            losses[epoch, fitness] = float(training.generator_loss(32).detach())
    assert losses[0, 1] == pytest.approx(losses[0, 0])
    assert all(losses[epoch, 1] > losses[epoch, 0] + 0.1 for epoch in (1, 2))


def test_the_discriminator_learns_to_tell_seeds_from_a_collapsed_generator(assembled, vanilla, seeds):
    training = assembled(vanilla)
    with torch.no_grad():
        for p in training.sampler.network.parameters():
            p.zero_()
    (critic,) = critics(training)
    optimiser = torch.optim.Adam(critic.parameters(), 1e-3)
    for _ in range(50):
        optimiser.zero_grad()
        training.adversary_loss(torch.arange(32)).backward()
        optimiser.step()
    real = training.sampler.scaling.image(seeds.float())
    assert critic(real[32:64]).mean() > critic(training.sampler(32).images).mean() + 0.5


def test_an_eased_weight_grows_to_all_of_it():
    term = LossTerm(100.0, ease=0.01, start=1)
    assert term.weight_at(0, 0.5) == 0
    assert [term.weight_at(1, share) for share in (0.0, 0.5, 1.0)] == pytest.approx([1.0, 10.0, 100.0])


def loss_of(term):
    """The loss of coefficients."""
    return lambda c: term(Batch(c, lambda: c, None))


def test_distance_is_missed_by_a_shrunken_batch_alone(seeds):
    loss = loss_of(diversity.distance(1.0, distance_target(seeds)))
    assert loss(seeds.float()) < 1e-6 and loss(2 * seeds.float()) == 0
    c = (seeds.mean(0) + 0.3 * (seeds - seeds.mean(0))).float().requires_grad_(True)
    value = loss(c)
    (slope,) = torch.autograd.grad(value, c)
    better = c.detach() - 0.1 * slope / slope.norm()
    assert value > 0.1 and loss(better) < value
    assert torch.pdist(better.flatten(1)).mean() > torch.pdist(c.detach().flatten(1)).mean()


def test_rank_is_missed_by_a_batch_with_few_directions(constraints, family):
    c = random_trajectories(constraints, family, 0).float()
    loss = loss_of(diversity.rank(1.0, rank_target(c, 100)))
    assert loss(c[:100]) < 0.1
    vectors = torch.randn(2, c[0].numel(), generator=random())
    flat = (torch.randn(100, 2, generator=random()) @ vectors).view(100, *c.shape[1:]).requires_grad_(True)
    value = loss(flat)
    (slope,) = torch.autograd.grad(value, flat)
    assert value > 1 and torch.isfinite(slope).all()
    assert loss(flat.detach() - 0.5 * slope / slope.norm()) < value


def test_a_collapsed_batch_gives_a_finite_slope(seeds):
    noise = torch.randn(20, *seeds.shape[1:], generator=random())
    c = (seeds[:1].float() + 1e-6 * noise).requires_grad_(True)
    terms = (
        diversity.distance(1.0, distance_target(seeds)),
        diversity.rank(1.0, rank_target(seeds, 20)),
    )
    value = sum(loss_of(term)(c) for term in terms)
    (slope,) = torch.autograd.grad(value, c)
    assert torch.isfinite(value) and torch.isfinite(slope).all() and slope.abs().max() > 0
