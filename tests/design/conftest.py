"""Problems, matrices, trajectories and an oracle that tests of the room share."""

import math

import numpy as np
import pytest
from scipy.special import logsumexp

from sidegan.design.problem import Problem
from sidegan.kernels import HIGHEST, HOPELESS, LOWEST, SHARPNESS
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, Plane


@pytest.fixture(scope="session")
def lwr_problem(arm):
    constraints = Constraints(arm, [Plane((0, 0, 1), 0.1)])
    return Problem(constraints, Trajectory(7), 40)


@pytest.fixture(scope="session")
def planar_problem(planar):
    constraints = Constraints(planar, [Plane((0, 0, 1), 0.1)])
    return Problem(constraints, Trajectory(planar.joints, 3, 8.0), 24)


@pytest.fixture
def random():
    return np.random.default_rng(3)


def states_of(problem, c):
    """Positions and as many derivatives as are limited at a problem's samples, (B, T, J) each."""
    family, times = problem.trajectory, problem.trajectory.grid(problem.samples)
    return [family.derivative(c, times, order) for order in range(problem.constraints.orders)]


def semidefinite(seed, count=1, size=4, rank=6):
    """Random matrices of a rank, (count, size, size)."""
    rows = np.random.default_rng(seed).standard_normal((count, rank, size))
    return rows.mT @ rows


def trajectories(joints, batch=6):
    """A family, and some of it."""
    trajectory = Trajectory(joints, 4, 8.0)
    c = np.random.default_rng(5).standard_normal((batch, *trajectory.shape))
    return trajectory, 0.3 * c


def log_condition(x):
    """Logarithm of the smooth largest over the smooth smallest of values, ascending, (B, p) → (B,)."""
    positive = x[:, -1:] > 0
    values = np.where(positive, np.maximum(x, x[:, -1:] / HOPELESS), 1.0)
    low, high = np.log(values[:, :LOWEST]), np.log(values[:, -HIGHEST:])
    ends = logsumexp(-SHARPNESS * low, 1) + logsumexp(SHARPNESS * high, 1)
    return np.where(positive[:, 0], ends / SHARPNESS, math.log(HOPELESS))
