import math
from dataclasses import replace
from itertools import pairwise

import pytest
import torch

from sidegan.errors import ConfigError
from sidegan.gan.adversarial import AdversarialLoop
from sidegan.gan.variants import Weights

NONE = Weights(adversarial=0)


@pytest.fixture
def make_loop(full, seeds, predictor, converter):
    """A loop with the given weights, the same at every call."""

    def make(weights, converter=converter, predictor=predictor, **settings):
        torch.manual_seed(0)
        variant = replace(full, weights=weights, **settings)
        return AdversarialLoop(variant, seeds, 10, predictor, converter)

    return make


def stepped(loop, measure, size=0.05):
    """What ``measure`` makes of the same noise before and after one gradient step of the generator."""
    torch.manual_seed(1)
    z = loop.generator.draw(200)

    def now():
        with torch.no_grad():
            return float(measure(loop.scaling.coefficients(loop.generator(z))))

    before = now()
    loop._generator_loss(500).backward()
    norm = torch.stack([p.grad.norm() for p in loop.generator.parameters()]).norm()
    with torch.no_grad():
        for p in loop.generator.parameters():
            p -= size * p.grad / norm
    return before, now()


def log_ratio(converter):
    def measure(c):
        logs = converter.log_features(converter(c))
        return (logs.amax(1) - logs.amin(1)).mean()

    return measure


def test_the_success_loss_raises_the_predicted_success(make_loop, predictor):
    before, after = stepped(make_loop(replace(NONE, success=1)), lambda c: predictor(c).mean())
    assert after > before


def test_the_fitness_loss_lowers_the_predicted_ratio(make_loop, converter):
    loop = make_loop(replace(NONE, fitness=1), fitness_start=0)
    before, after = stepped(loop, log_ratio(converter))
    assert after < before


def test_the_adversarial_losses_raise_what_the_critics_say(make_loop, converter):
    loop = make_loop(Weights())
    before, after = stepped(loop, lambda c: loop.critic(loop.scaling.image(c)).mean())
    assert after > before
    loop = make_loop(replace(NONE, features=1))
    before, after = stepped(loop, lambda c: loop.feature_critic(converter(c)).mean())
    assert after > before


@pytest.mark.parametrize("term", ["spread", "distance"])
def test_the_diversity_losses_widen_a_generator_that_shrank(make_loop, term):
    loop = make_loop(replace(NONE, **{term: 1}))
    with torch.no_grad():
        loop.generator.shortcut.weight *= 0.3
    before, after = stepped(loop, lambda c: torch.pdist(c.flatten(1)).mean())
    assert after > before


def test_fitness_counts_from_its_first_epoch_on(make_loop, monkeypatch):
    losses = {}
    for epoch in (0, 1, 2):
        monkeypatch.setattr(AdversarialLoop, "current_epoch", epoch)
        for fitness in (0, 1):
            loop = make_loop(Weights(fitness=fitness), fitness_start=1)
            torch.manual_seed(2)
            losses[epoch, fitness] = float(loop._generator_loss(32).detach())
    assert losses[0, 1] == losses[0, 0]
    assert losses[1, 1] > losses[1, 0]
    assert losses[2, 1] > losses[2, 0]


def test_the_critic_learns_to_tell_seeds_from_a_collapsed_generator(vanilla, seeds):
    torch.manual_seed(0)
    loop = AdversarialLoop(vanilla, seeds, 10)
    with torch.no_grad():
        for p in loop.generator.parameters():
            p.zero_()
    real = loop.scaling.image(seeds.float())
    optimiser = torch.optim.Adam(loop.critic.parameters(), 1e-3)
    for _ in range(50):
        optimiser.zero_grad()
        loop._critic_loss(real[:32], None).backward()
        optimiser.step()
    fake = loop.generator(loop.generator.draw(32))
    assert loop.critic(real[32:64]).mean() > loop.critic(fake).mean() + 0.5


def test_the_gradient_penalty_is_the_slope_at_the_seeds(vanilla, seeds):
    torch.manual_seed(0)
    with_penalty = AdversarialLoop(replace(vanilla, gradient_penalty=4.0), seeds, 10)
    without = AdversarialLoop(replace(vanilla, gradient_penalty=0.0), seeds, 10)
    without.load_state_dict(with_penalty.state_dict())
    real = with_penalty.scaling.image(seeds[:20].float()).requires_grad_(True)
    losses = []
    for loop in (with_penalty, without):
        torch.manual_seed(3)
        losses.append(loop._critic_loss(real, None))
    (slope,) = torch.autograd.grad(without.critic(real).sum(), real)
    expected = 4.0 / 2 * (slope**2).sum((1, 2, 3)).mean()
    torch.testing.assert_close(losses[0] - losses[1], expected, rtol=1e-3, atol=1e-6)


def test_a_gaussian_start_samples_around_the_seeds(vanilla, seeds):
    torch.manual_seed(0)
    c = AdversarialLoop(vanilla, seeds, 10).sample(4000, torch.Generator().manual_seed(0))
    assert c.dtype == torch.float64 and not c.requires_grad
    assert (c.mean(0) - seeds.mean(0)).abs().max() < 0.1 * seeds.std(0).max()
    wanted, found = torch.cov(seeds.flatten(1).T), torch.cov(c.flatten(1).T)
    assert (found - wanted).norm() < 0.3 * wanted.norm()


@pytest.mark.parametrize("decay", [True, False])
def test_rates_fall_along_half_a_cosine_only_with_decay(vanilla, seeds, decay):
    loop = AdversarialLoop(replace(vanilla, decay=decay), seeds, 10)
    rates = [loop._rate(step) for step in range(12)]
    if not decay:
        assert set(rates) == {1.0}
        return
    assert rates[0] == 1 and all(a > b for a, b in pairwise(rates[:11]))
    assert rates[5] == pytest.approx((1 + rates[10]) / 2)
    assert 0 < rates[10] == rates[11] < 0.1
    assert not math.isnan(rates[11])


@pytest.mark.parametrize("missing", ["predictor", "converter"])
def test_a_variant_without_its_surrogates_is_refused(make_loop, missing):
    with pytest.raises(ConfigError, match=f"diagonal needs a {missing}"):
        make_loop(Weights(success=1), **{missing: None})
