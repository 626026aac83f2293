"""The smooth condition number in closed forms, and where nothing is excited."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sidegan.design.goal import Goal
from sidegan.design.objective import Objective
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


@pytest.mark.parametrize("kind", ["condition", "diagonal"])
def test_rest_that_feels_no_torque_is_the_worst_there_is(planar, kind):
    """Without gravity: all elements of its Gram matrix are equal, which is not the best ratio of them."""
    arm = replace(planar, gravity=0 * planar.gravity)
    problem, gradient = Problem(Constraints(arm), Trajectory(2, 3, 8.0)), np.ones((2, 6))
    value, cost = Objective(problem, Goal(kind))(np.zeros((2, 6)), gradient)
    assert value == math.inf and cost == 0 and (gradient == 0).all()
