"""Exact physics that gradients pass through: finite differences, Gram matrices."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from sidegan.design.penalty import Penalty
from sidegan.design.problem import Problem
from sidegan.gan import reward
from sidegan.gan.tensors import tensor
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, Plane
from tests.chains import driven

WEIGHTS = {"equal": [1.0] * 7, "joints": [9.0, 8.0, 5.0, 4.0, 2.0, 1.0, 0.5]}


@pytest.fixture(scope="module")
def arm_problem(arm):
    return Problem(Constraints(arm, [Plane((0, 0, 1), 0.1)]), Trajectory(7, 4, 8.0), 24)


@pytest.fixture
def noise():
    return np.random.default_rng(3)


@pytest.fixture
def directions(arm_problem, noise):
    return noise.standard_normal((arm_problem.body.parameters_count, 3))


def by_autograd(function, c):
    """Value and gradient, as arrays, of a function that torch differentiates."""
    x = tensor(c).requires_grad_(True)
    value = function(x)
    return float(value.detach()), torch.autograd.grad(value, x)[0].numpy()


def assert_slope(function, c, noise):
    """The gradient of a number is that of central differences; the number."""
    direction = noise.standard_normal(c.shape)
    up, down = (float(function(tensor(c + step * direction))) for step in (1e-6, -1e-6))
    value, gradient = by_autograd(function, c)
    assert (up - down) / 2e-6 == pytest.approx((gradient * direction).sum(), rel=1e-4, abs=1e-6)
    return value


def test_energies_are_those_of_the_gram_matrix(arm_problem, noise, directions):
    c, equal = arm_problem.start(200, noise), np.ones(7)
    expected = (directions * (arm_problem.gram(c) @ directions)).sum(1)
    np.testing.assert_allclose(reward.energies_of(arm_problem, c, directions, equal), expected)
    np.testing.assert_allclose(reward.energies(arm_problem, tensor(c), directions, 2 * equal), 4 * expected)


@pytest.mark.parametrize("weights", WEIGHTS)
def test_the_gradient_of_energies_agrees_with_finite_differences(arm_problem, noise, directions, weights):
    def logs(x):
        return reward.energies(arm_problem, x, directions, np.array(WEIGHTS[weights])).log().sum()

    assert_slope(logs, arm_problem.start(4, noise, 0.9), noise)


@pytest.mark.parametrize("prepared", [lambda arm: arm, driven], ids=["rigid", "driven"])
def test_the_gradient_of_the_violation_agrees_with_finite_differences(arm_problem, noise, prepared):
    arm = prepared(arm_problem.constraints.arm)
    problem = replace(arm_problem, constraints=Constraints(replace(arm, torque_limit=arm.torque_limit / 2)))

    def squares(x):
        return reward.violation(problem, x, Penalty(3.0)).square().sum()

    assert assert_slope(squares, problem.start(4, noise, 1.6), noise) > 1e-3


def test_single_precision_and_rest_have_finite_energies_and_slopes(planar, noise):
    problem = Problem(Constraints(planar), Trajectory(2, 3, 8.0), 24)
    every, equal = np.eye(problem.body.parameters_count), np.ones(2)

    def total(x):
        return reward.energies(problem, x, every, equal).sum()

    for c in (problem.start(4, noise), np.zeros((2, *problem.trajectory.shape))):
        value, slope = by_autograd(total, c.astype(np.float32))
        assert slope.dtype == np.float32 and np.isfinite(value) and np.isfinite(slope).all()
