"""The smooth condition number: finite differences, closed forms; batches of values and gradients."""

import math
from dataclasses import replace

import pytest
import torch

from sidegan.design.objective import value_and_gradient
from sidegan.design.objectives import log_condition
from sidegan.design.penalty import Penalty
from sidegan.design.problem import HOPELESS, Problem
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints

from .conftest import by_autograd


@pytest.mark.parametrize("count", [1, 3, 4, 9])
def test_the_slopes_of_the_smooth_condition_number_agree_with_finite_differences(random, count):
    values = (1 + torch.rand(5, count, generator=random, dtype=torch.float64)).cumsum(1)
    assert torch.autograd.gradcheck(log_condition, values.requires_grad_(True))
    value, values = log_condition(values).detach(), values.detach()
    _, slopes = by_autograd(lambda x: log_condition(x).sum())(values)
    assert (value >= (values[:, -1] / values[:, 0]).log() - 1e-12).all()
    torch.testing.assert_close((values * slopes).sum(1), torch.zeros(5).double())  # units do not matter


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        # Equal extremes are log(number) / 6 outside of the true ones, whatever lies between.
        ([0.5, 0.5, 0.5, 3.0, 8.0, 8.0], math.log(16) + (math.log(3) + math.log(2)) / 6),
        ([0.5, 400, 500, 600, 700, 1e6], math.log(2e6)),
        # What is not excited is as bad as hopeless and no worse; where nothing is told at all, as bad.
        ([0.0, 5.0, 5.0, 5.0, 7.0], math.log(HOPELESS) + math.log(1 + (5 / 7) ** 6) / 6),
        ([0.0] * 5, math.log(HOPELESS)),
    ],
)
def test_the_smooth_condition_number_by_hand(values, expected):
    value, slopes = by_autograd(lambda x: log_condition(x).sum())(torch.tensor([values]).double())
    assert float(value) == pytest.approx(expected, rel=1e-9) and slopes.isfinite().all()
    if not any(values):
        assert (slopes == 0).all()
    elif not values[0]:
        assert float(slopes[0, 0]) == pytest.approx(-HOPELESS / values[-1])


@pytest.mark.parametrize("diagonal", [False, True])
def test_rest_that_feels_no_torque_is_the_worst_there_is(planar, diagonal):
    """Without gravity: all elements of its Gram matrix are equal, which is not the best ratio of them."""
    arm = replace(planar, gravity=0 * planar.gravity)
    problem = Problem(Constraints(arm), Trajectory(2, 3, 8.0), diagonal=diagonal)
    value, gradient = value_and_gradient(problem, torch.zeros(2, 2, 3, 2).double(), Penalty(0.0))
    assert (value == pytest.approx(math.log(HOPELESS))) and (gradient == 0).all()


def test_a_batch_is_the_same_as_one_by_one(planar_problem, random):
    c = planar_problem.start(3, random)
    together = value_and_gradient(planar_problem, c, Penalty(30.0))
    alone = zip(*(value_and_gradient(planar_problem, one[None], Penalty(30.0)) for one in c))
    for whole, parts in zip(together, alone):
        torch.testing.assert_close(torch.cat(parts), whole)
