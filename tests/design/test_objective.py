"""The smooth condition number in closed forms; batches of values and gradients."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sidegan.design.objective import value_and_gradient
from sidegan.design.penalty import Penalty
from sidegan.design.problem import HOPELESS, Problem
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints

from .conftest import log_condition


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
    value = log_condition(np.array([values]))
    assert value.item() == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("diagonal", [False, True])
def test_rest_that_feels_no_torque_is_the_worst_there_is(planar, diagonal):
    """Without gravity: all elements of its Gram matrix are equal, which is not the best ratio of them."""
    arm = replace(planar, gravity=0 * planar.gravity)
    problem = Problem(Constraints(arm), Trajectory(2, 3, 8.0), diagonal=diagonal)
    value, gradient = value_and_gradient(problem, np.zeros((2, 2, 3, 2)), Penalty(0.0))
    assert value == pytest.approx(math.log(HOPELESS)) and (gradient == 0).all()


def test_a_batch_is_the_same_as_one_by_one(planar_problem, random):
    c = planar_problem.start(3, random)
    together = value_and_gradient(planar_problem, c, Penalty(30.0))
    alone = zip(*(value_and_gradient(planar_problem, one[None], Penalty(30.0)) for one in c))
    for whole, parts in zip(together, alone):
        np.testing.assert_allclose(np.concatenate(parts), whole)
