"""Problems, matrices and trajectories that tests of the room share."""

import numpy as np
import pytest

from sidegan.design.problem import Problem
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


def semidefinite(seed, count=1, size=4, rank=6):
    """Random matrices of a rank, (count, size, size)."""
    rows = np.random.default_rng(seed).standard_normal((count, rank, size))
    return rows.mT @ rows


def trajectories(joints, batch=6):
    """A family, and some of it."""
    trajectory = Trajectory(joints, 4, 8.0)
    c = np.random.default_rng(5).standard_normal((batch, *trajectory.shape))
    return trajectory, 0.3 * c
