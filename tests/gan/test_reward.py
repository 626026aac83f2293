"""Exact physics by finite differences and Gram matrices; worth by laws that copies and sizes cannot fool."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from sidegan.design.objective import Penalty
from sidegan.design.prediction import random_motions
from sidegan.design.problem import Problem
from sidegan.gan.metrics import noises
from sidegan.gan.reward import DirectionEnergies, Energies, Worth, violation
from sidegan.gan.settings import Reward
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, Plane
from tests.chains import driven
from tests.gan.conftest import random


@pytest.fixture(scope="module")
def arm_problem(arm):
    return Problem(Constraints(arm, [Plane((0, 0, 1), 0.1)]), Trajectory(7, 4, 8.0), 24)


@pytest.fixture
def noise():
    return np.random.default_rng(3)


@pytest.fixture
def directions(arm_problem, noise):
    return noise.standard_normal((arm_problem.body.parameters_count, 3))


def slope_of(function, x):
    """Gradient of a function that torch differentiates."""
    x = x.clone().requires_grad_(True)
    return torch.autograd.grad(function(x), x)[0]


def assert_slope(function, c, noise):
    """The gradient of a number is that of central differences."""
    direction = noise.standard_normal(c.shape)
    up, down = (float(function(torch.tensor(c + step * direction))) for step in (1e-6, -1e-6))
    expected = float((slope_of(function, torch.tensor(c)) * torch.tensor(direction)).sum())
    assert (up - down) / 2e-6 == pytest.approx(expected, rel=1e-4, abs=1e-6)


def test_energies_are_those_of_the_gram_matrix(arm_problem, noise, directions):
    c = arm_problem.start(200, noise)
    expected = (directions * (arm_problem.gram(c) @ directions)).sum(1)
    np.testing.assert_allclose(
        DirectionEnergies.apply(torch.tensor(c), arm_problem, directions, np.full(7, 2.0)), 4 * expected
    )


def test_the_gradient_of_energies_agrees_with_finite_differences(arm_problem, noise, directions):
    def logs(x):
        return DirectionEnergies.apply(x, arm_problem, directions, np.linspace(9, 0.5, 7)).log().sum()

    assert_slope(logs, arm_problem.start(4, noise, 0.9), noise)


@pytest.mark.parametrize("prepared", [lambda arm: arm, driven], ids=["rigid", "driven"])
def test_the_gradient_of_the_violation_agrees_with_finite_differences(arm_problem, noise, prepared):
    arm = prepared(arm_problem.constraints.arm)
    problem = replace(arm_problem, constraints=Constraints(replace(arm, torque_limit=arm.torque_limit / 2)))

    def squares(x):
        return violation(problem, x, Penalty(3.0)).square().sum()

    c = problem.start(4, noise, 1.6)
    assert squares(torch.tensor(c)) > 1e-3
    assert_slope(squares, c, noise)


def test_single_precision_and_rest_have_finite_energies_and_gradients(planar, noise):
    problem = Problem(Constraints(planar), Trajectory(2, 3, 8.0), 24)
    every, equal = np.eye(problem.body.parameters_count), np.ones(2)

    def total(x):
        return DirectionEnergies.apply(x, problem, every, equal).sum()

    for c in (problem.start(4, noise), np.zeros((2, *problem.trajectory.shape))):
        slope = slope_of(total, torch.tensor(c).float())
        assert slope.dtype == torch.float32 and torch.isfinite(slope).all()
        assert violation(problem, torch.tensor(c).float(), Penalty(3.0)).dtype == torch.float32


@pytest.fixture(scope="module")
def problem(constraints, family):
    return Problem(constraints, family, 24)


@pytest.fixture(params=["proportional", "constant"])
def worth(request, problem):
    return Worth(problem, noises(problem.body)[request.param])


def test_the_mean_is_worth_one_and_a_smaller_motion_less(worth, problem):
    c = torch.tensor(random_motions(problem, 8, seed=1))
    value = worth(torch.cat([c, 0.5 * c]))
    assert float(value[:8].exp().mean()) == pytest.approx(1, abs=1e-6)
    assert (value[8:] < value[:8]).all()


def test_copies_are_worth_less_than_another(worth, problem):
    c = torch.tensor(random_motions(problem, 9, seed=1))
    copied, others = c[:1].expand(8, -1, -1, -1), c[1:]
    for _ in range(3):
        worth(copied)
    assert worth(torch.cat([copied, others]))[8:].mean() > 0.5


def test_worth_by_energies_has_the_exact_gradient_at_the_seeds(constraints, family, seeds):
    """Where the mean energies are one, and the running means those of the seeds."""
    seeds = seeds[:64]
    told = Energies(constraints, family, seeds)
    of_seeds = told(seeds)
    logs = torch.tensor(of_seeds).log()
    np.testing.assert_allclose(of_seeds.mean(0), 1, rtol=0, atol=1e-6)
    for name, noise in noises(constraints.body).items():
        exact = Worth(told.problem, noise)
        exact.learn(seeds)
        shares = torch.tensor(exact.slope[1])
        only = Reward(**{key: float(key == name) for key in told.parts})
        part = list(told.parts).index(name)
        slope = slope_of(lambda x, only=only: told.worth(x, only), logs)
        own, energy = (x.split(len(shares), 1)[part] for x in (slope, logs.exp()))
        expected = shares * energy / (energy @ shares)[:, None] / len(seeds)
        torch.testing.assert_close(own, expected, rtol=1e-6, atol=1e-9)


def test_a_well_known_direction_counts_less(constraints, family, seeds):
    told = Energies(constraints, family, seeds[:64])
    logs = torch.randn(32, told(seeds[:1]).shape[1], generator=random(), dtype=torch.float64)
    known = logs.clone()
    known[:, 0] += 3
    known, plain = (slope_of(lambda x: told.worth(x, Reward()), x)[:, 0].sum() for x in (known, logs))
    assert known < plain
