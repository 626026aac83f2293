"""Exact physics that gradients pass through: finite differences, Gram matrices."""

from dataclasses import replace

import pytest
import torch

from sidegan.design import physics
from sidegan.design.penalty import Penalty
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints
from tests.chains import driven

from .conftest import assert_slopes, by_autograd

WEIGHTS = {"equal": [1.0] * 7, "joints": [9.0, 8.0, 5.0, 4.0, 2.0, 1.0, 0.5]}


@pytest.fixture(scope="module")
def arm_problem(lwr_problem):
    return replace(lwr_problem, trajectory=Trajectory(7, 4, 8.0), samples=24)


@pytest.fixture
def directions(arm_problem, random):
    return torch.randn(arm_problem.body.parameters_count, 3, generator=random, dtype=torch.float64)


def test_energies_are_those_of_the_gram_matrix(arm_problem, random, directions):
    c, equal = arm_problem.start(200, random), torch.ones(7, dtype=torch.float64)
    expected = torch.einsum("pk,bpq,qk->bk", directions, arm_problem.gram(c), directions)
    torch.testing.assert_close(physics.energies(arm_problem, c, directions, equal), expected)
    twice = physics.energies(arm_problem, c, directions, 2 * equal)
    torch.testing.assert_close(twice, 4 * expected)


@pytest.mark.parametrize("weights", WEIGHTS)
def test_the_gradient_of_energies_agrees_with_finite_differences(arm_problem, random, directions, weights):
    def logs(x):
        weighed = torch.tensor(WEIGHTS[weights], dtype=torch.float64)
        return physics.energies(arm_problem, x, directions, weighed).log().sum()

    assert_slopes(by_autograd(logs), arm_problem.start(4, random, 0.9), random, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("prepared", [lambda arm: arm, driven], ids=["rigid", "driven"])
def test_the_gradient_of_the_violation_agrees_with_finite_differences(arm_problem, random, prepared):
    arm = prepared(arm_problem.constraints.arm)
    arm_problem = replace(
        arm_problem, constraints=Constraints(replace(arm, torque_limit=arm.torque_limit / 2))
    )

    def squares(x):
        return physics.violation(arm_problem, x, Penalty(3.0)).square().sum()

    c = arm_problem.start(4, random, 1.6)
    assert assert_slopes(by_autograd(squares), c, random, rtol=1e-4, atol=1e-6) > 1e-3


def test_single_precision_and_rest_have_finite_energies_and_slopes(planar_problem, random):
    size, equal = planar_problem.body.parameters_count, torch.ones(2, dtype=torch.float64)
    every = torch.eye(size, dtype=torch.float64)
    for c in (planar_problem.start(4, random).float(), torch.zeros(2, *planar_problem.trajectory.shape)):
        value, slope = by_autograd(lambda x: physics.energies(planar_problem, x, every, equal).sum())(c)
        assert slope.dtype == torch.float32 and torch.isfinite(value) and torch.isfinite(slope).all()
