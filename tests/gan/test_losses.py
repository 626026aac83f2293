"""Losses by closed forms, and by what one step of the generator on each of them changes."""

from copy import deepcopy
from dataclasses import replace

import pytest
import torch

from sidegan.gan.losses import Batch, common_offset, missing_distance, missing_rank
from sidegan.gan.scaling import CoefficientBox
from sidegan.gan.side_gan import SideGAN
from sidegan.gan.training import random_trajectories
from sidegan.gan.variants import Exact
from tests.gan.conftest import FULL, NONE, normal, random


def test_losses_equal_their_closed_forms(made, full):
    model = made(full)
    batch, predictor, converter = model(32), model.success_predictor, model.converter
    c, first, second = batch.coefficients, model.discriminator.network, model.second_discriminator.network
    logs = converter.log_features(converter(c))
    expected = [
        -torch.log(first(batch.images).sigmoid()).mean(),  # D1
        -predictor.log_probability(predictor.margins(c) - full.reserve).mean(),
        -torch.log(second(converter(c)).sigmoid()).mean(),  # D2
        (logs.amax(1) - logs.amin(1)).mean(),
    ]
    for loss, value in zip(model.losses(), expected, strict=True):
        torch.testing.assert_close(loss.value(batch), value)
    for own in model.adversaries:
        real, fake = own.network(own.examples[:9]).sigmoid(), own.network(own.view(batch)).sigmoid()
        told_apart = -torch.log(real).mean() - torch.log(1 - fake).mean()
        steep = full.generator.penalty / 2 * squared_slope(own.network, own.examples[:9])
        torch.testing.assert_close(own.own_loss(torch.arange(9), batch), told_apart + steep.float())
        own.penalty = 0.0
        torch.testing.assert_close(own.own_loss(torch.arange(9), batch), told_apart)


def squared_slope(network, examples, step=1e-6):
    """Mean squared gradient of the summed logits by central differences, in double precision."""
    network, flat = deepcopy(network).double(), examples.double().flatten()

    def at(x):
        return network(x.view_as(examples)).sum()

    steps = step * torch.eye(len(flat), dtype=flat.dtype)
    slopes = [(at(flat + one) - at(flat - one)) / (2 * step) for one in steps]
    return torch.stack(slopes).square().sum().detach() / len(examples)


def test_the_loss_is_the_weighted_sum_of_active_losses(made, full, monkeypatch):
    for epoch in (0, 1):
        monkeypatch.setattr(SideGAN, "current_epoch", epoch)
        model = made(replace(full, fitness_start=1))
        torch.manual_seed(2)
        found = float(model.generator_loss(32).detach())
        torch.manual_seed(2)
        batch = model(32)
        losses = [*model.losses(), *model.floors]
        assert len(losses) == 7 and losses[3].weight == epoch
        assert found == pytest.approx(sum(loss.weight * float(loss.value(batch).detach()) for loss in losses))


def test_discriminators_of_zero_weight_do_not_learn(made, full):
    for weights, count in ((FULL, 2), (replace(FULL, features=0), 1), (replace(NONE, rank=1), 0)):
        model = made(replace(full, weights=weights))
        assert sum(weight > 0 for weight in model.adversaries.values()) == count
        adams, schedules = model.configure_optimizers()
        assert len(adams) == len(schedules) == 2


def test_the_weight_of_violations_grows_geometrically(data, exact):
    model, weights = Exact(exact, data), []
    for model.share in (0.0, 0.2, 0.4, 1.0):
        weights.append(model.losses()[0].weight / exact.weights.success)
    assert weights == pytest.approx([0.1, 0.1**0.5, 1, 1])


def loss_of(value):
    """The loss of coefficients."""
    return lambda c: value(Batch(c, c, c, lambda: c))


def test_only_a_shrunken_batch_has_a_distance_loss(seeds):
    loss, c = loss_of(missing_distance(seeds)), torch.tensor(seeds).float()
    assert loss(c) < 1e-6 and loss(2 * c) == 0
    assert float(loss(0.3 * c)) == pytest.approx(0.7, rel=1e-4)


def test_a_batch_with_few_directions_has_a_rank_loss(constraints, family):
    c = random_trajectories(constraints, family, 0)
    loss = loss_of(missing_rank(c, 100))
    assert loss(torch.tensor(c[:100])) < 0.1
    vectors = torch.randn(2, c[0].size, generator=random())
    flat = (torch.randn(100, 2, generator=random()) @ vectors).view(100, *c.shape[1:]).requires_grad_(True)
    value = loss(flat)
    (slope,) = torch.autograd.grad(value, flat)
    assert value > 1 and torch.isfinite(slope).all()
    assert loss(flat.detach() - 0.5 * slope / slope.norm()) < value


def test_a_common_offset_costs_although_distances_do_not_change(seeds):
    c = torch.tensor(seeds[:100]).float()
    offset, rank, distance = common_offset(seeds), missing_rank(seeds, 100), missing_distance(seeds)
    shifted = c + 3 * c.std(0)
    assert loss_of(offset)(c) < 0.01 and loss_of(rank)(c) < 0.05
    assert float(loss_of(distance)(shifted) - loss_of(distance)(c)) == pytest.approx(0, abs=1e-5)
    assert loss_of(offset)(shifted) > 0.5 and loss_of(rank)(shifted) > 0.5
    copies = c[:1].expand(20, *c.shape[1:])
    assert float(loss_of(offset)(copies)) == pytest.approx(1, abs=0.01)
    opposed = torch.cat([c, -c])  # nothing in common
    assert loss_of(offset)(opposed) == 0


@pytest.mark.parametrize(("common", "needed"), [(0.1, 0.01), (1.0, 0.5), (10.0, 0.99)])
def test_what_seeds_have_in_common_is_allowed_only_as_far_as_it_is_little(common, needed):
    """By closed form: rows in orthogonal directions, and one direction that all share."""
    own, shared = torch.eye(40).split([39, 1])
    c = (own + common * shared).reshape(39, 2, 5, 4)
    cosine = common**2 / (1 + common**2)  # between any two
    assert cosine >= 0.97 * needed
    loss = loss_of(common_offset(c.double().numpy()))
    assert float(loss(c)) == pytest.approx(max(cosine - 0.03, 0), abs=1e-5)
    apart = own.reshape(c.shape)
    assert loss_of(common_offset(torch.cat([apart, -apart]).double().numpy()))(apart) < 1e-6


def test_coefficients_pushed_against_the_box_are_drawn_back(made, full):
    model = made(full)
    model.generator.box, bias = CoefficientBox(0.2), model.generator.network.shortcut.bias
    with torch.no_grad():
        bias += 20.0
    batch, (*_, offset) = model(50), model.floors
    (through_the_box,) = torch.autograd.grad(batch.coefficients.sum(), bias, retain_graph=True)
    (slope,) = torch.autograd.grad(offset.value(batch), bias)
    assert through_the_box.abs().max() < 1e-9 < 1e-6 < slope.abs().max()


def test_a_collapsed_batch_has_a_finite_gradient(seeds, family):
    c = (torch.tensor(seeds[:1]).float() + normal(family, 0, 1e-6, 20)).requires_grad_(True)
    floors = missing_distance(seeds), missing_rank(seeds, 20), common_offset(seeds)
    value = sum(loss_of(floor)(c) for floor in floors)
    (slope,) = torch.autograd.grad(value, c)
    assert torch.isfinite(value) and torch.isfinite(slope).all() and slope.abs().max() > 0
