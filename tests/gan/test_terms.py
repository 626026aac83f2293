from dataclasses import replace
from itertools import pairwise

import pytest
import torch

from sidegan.errors import ConfigError
from sidegan.gan.loop import Training, averaged
from sidegan.gan.surrogates import Surrogates
from sidegan.gan.terms import Adversary, LossTerm
from sidegan.gan.training import Run, assemble
from sidegan.gan.variants import Losses
from tests.gan.conftest import ADVERSARIAL, FULL, NONE, random


@pytest.fixture
def assembled(constraints, family, seeds, tmp_path):
    """An untrained variant, the same at every call."""

    def make(variant, *surrogates):
        torch.manual_seed(0)
        run = Run("diagonal", 0, tmp_path)
        return assemble(variant, constraints, family, seeds, run, Surrogates(*surrogates))

    return make


@pytest.fixture
def weighed(assembled, full, predictor, converter):
    """An untrained variant with the given weights."""

    def make(weights, predictor=predictor, converter=converter, **settings):
        return assembled(replace(full, weights=weights, **settings), predictor, converter)

    return make


def adversaries(training):
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


def log_ratio(converter):
    return lambda c: log_ratios(converter, c).mean()


def test_the_success_loss_raises_the_predicted_success(weighed, predictor):
    before, after = stepped(weighed(replace(NONE, success=1)), lambda c: predictor(c).mean())
    assert after > before


def test_the_fitness_loss_lowers_the_predicted_ratio(weighed, converter):
    training = weighed(replace(NONE, fitness=1), fitness_start=0)
    before, after = stepped(training, log_ratio(converter))
    assert after < before


def test_the_adversarial_losses_raise_what_the_discriminators_say(weighed, converter):
    training = weighed(ADVERSARIAL)
    critic, scaling = adversaries(training)[0], training.sampler.scaling
    before, after = stepped(training, lambda c: critic(scaling.image(c)).mean())
    assert after > before
    training = weighed(replace(NONE, features=1))
    critic = adversaries(training)[1]
    before, after = stepped(training, lambda c: critic(converter(c)).mean())
    assert after > before


def test_the_printed_losses_are_their_closed_forms(weighed, predictor, converter):
    printed = Losses("minimax", "probability", "ratio")
    training = weighed(FULL, losses=printed, fitness_start=0)
    batch = training.sampler(32)
    first, second = (critic.eval() for critic in adversaries(training))
    c = batch.coefficients
    expected = {
        0: torch.log(1 - first(batch.images).sigmoid()).mean(),  # D1
        1: 1 - predictor(c).exp().mean(),
        2: torch.log(1 - second(converter(c)).sigmoid()).mean(),  # D2
        3: torch.exp(log_ratios(converter, c)).mean(),
    }
    for i, value in expected.items():
        torch.testing.assert_close(training.parts[i](batch), value, rtol=1e-4, atol=1e-6)


def test_our_losses_are_their_logs(weighed, predictor, converter):
    training = weighed(FULL, fitness_start=0)
    batch = training.sampler(32)
    c, (first, _) = batch.coefficients, adversaries(training)
    torch.testing.assert_close(training.parts[0](batch), -torch.log(first(batch.images).sigmoid()).mean())
    torch.testing.assert_close(training.parts[1](batch), -predictor(c).mean())
    torch.testing.assert_close(training.parts[3](batch), log_ratios(converter, c).mean())


def test_adam_has_the_betas_of_the_settings(weighed):
    adams, _ = weighed(FULL, betas=(0.5, 0.999)).configure_optimizers()
    assert len(adams) == 2
    assert all(group["betas"] == (0.5, 0.999) for adam in adams for group in adam.param_groups)


def test_the_second_discriminator_may_see_predicted_features_of_the_seeds(weighed, converter, seeds):
    exact, predicted = (
        weighed(FULL, real_features=x).adversaries[1].examples for x in ("exact", "predicted")
    )
    torch.testing.assert_close(predicted, converter(seeds.float()))
    assert (exact - predicted).abs().max() > 1e-3


def test_averaged_weights_begin_as_a_mean_and_then_forget():
    network = torch.nn.Linear(1, 1, bias=False)
    average = averaged(network, 0.75)
    seen = []
    for value in (1.0, 2.0, 3.0, 4.0, 5.0):
        with torch.no_grad():
            network.weight.fill_(value)
        average.update_parameters(network)
        seen.append(float(average.module.weight.detach()))
    assert seen == pytest.approx([1, 1.5, 2, 2.5, 2.5 + (5 - 2.5) / 4])


@pytest.mark.parametrize("term", ["spread", "distance"])
def test_the_diversity_losses_widen_a_generator_that_shrank(weighed, term):
    training = weighed(replace(NONE, **{term: 1}))
    with torch.no_grad():
        training.sampler.network.shortcut.weight *= 0.3
    before, after = stepped(training, lambda c: torch.pdist(c.flatten(1)).mean())
    assert after > before


def test_fitness_counts_from_its_first_epoch_on(weighed, monkeypatch):
    losses = {}
    for epoch in (0, 1, 2):
        monkeypatch.setattr(Training, "current_epoch", epoch)
        for fitness in (0, 1):
            training = weighed(replace(ADVERSARIAL, fitness=fitness), fitness_start=1)
            torch.manual_seed(2)
            losses[epoch, fitness] = float(training.generator_loss(32).detach())
    assert losses[0, 1] == pytest.approx(losses[0, 0])
    assert losses[1, 1] > losses[1, 0] + 0.1
    assert losses[2, 1] > losses[2, 0] + 0.1


def test_the_discriminator_learns_to_tell_seeds_from_a_collapsed_generator(assembled, vanilla, seeds):
    training = assembled(vanilla)
    with torch.no_grad():
        for p in training.sampler.network.parameters():
            p.zero_()
    (critic,) = adversaries(training)
    optimiser = torch.optim.Adam(critic.parameters(), 1e-3)
    for _ in range(50):
        optimiser.zero_grad()
        training.adversary_loss(torch.arange(32)).backward()
        optimiser.step()
    real = training.sampler.scaling.image(seeds.float())
    assert critic(real[32:64]).mean() > critic(training.sampler(32).images).mean() + 0.5


def test_the_gradient_penalty_is_the_slope_at_the_seeds(assembled, vanilla, seeds):
    penalised, plain = (assembled(replace(vanilla, gradient_penalty=x)) for x in (4.0, 0.0))
    losses = []
    for training in (penalised, plain):
        torch.manual_seed(3)
        losses.append(training.adversary_loss(torch.arange(20)))
    real = plain.sampler.scaling.image(seeds[:20].float()).requires_grad_(True)
    (slope,) = torch.autograd.grad(adversaries(plain)[0](real).sum(), real)
    expected = 4.0 / 2 * (slope**2).sum((1, 2, 3)).mean()
    torch.testing.assert_close(losses[0] - losses[1], expected, rtol=1e-3, atol=1e-6)


def test_a_gaussian_start_samples_around_the_seeds(assembled, vanilla, seeds):
    with torch.no_grad():
        c = assembled(vanilla).sampler(4000, random()).coefficients.double()
    assert (c.mean(0) - seeds.mean(0)).abs().max() < 0.1 * seeds.std(0).max()
    expected, covariance = torch.cov(seeds.flatten(1).T), torch.cov(c.flatten(1).T)
    assert (covariance - expected).norm() < 0.3 * expected.norm()


@pytest.mark.parametrize("decay", [True, False])
def test_rates_fall_along_half_a_cosine_only_with_decay(vanilla, decay):
    schedule = replace(vanilla, decay=decay, epochs=2, steps=5).schedule(100)
    rates = [schedule.rate(step) for step in range(12)]
    if not decay:
        assert set(rates) == {1.0}
        return
    assert rates[0] == 1 and all(a > b for a, b in pairwise(rates[:11]))
    assert rates[5] == pytest.approx((1 + rates[10]) / 2)
    assert 0 < rates[10] < 0.1 and rates[11] == pytest.approx(rates[10])


def test_an_eased_weight_grows_to_all_of_it():
    term = LossTerm(100.0, ease=0.01, start=1)
    assert term.weight_at(0, 0.5) == 0
    assert [term.weight_at(1, share) for share in (0.0, 0.5, 1.0)] == pytest.approx([1.0, 10.0, 100.0])


@pytest.mark.parametrize("missing", ["predictor", "converter"])
def test_a_variant_without_its_surrogates_is_refused(weighed, missing):
    with pytest.raises(ConfigError, match=f"diagonal needs a {missing}"):
        weighed(replace(ADVERSARIAL, success=1), **{missing: None})
