"""Problems, workspaces, matrices and trajectories that tests of the room share."""

from dataclasses import replace

import numpy as np
import pytest

from sidegan.design.problem import Problem
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Box, Constraints, Convex, Plane, Sphere
from tests.chains import driven
from tests.validity.critical import filled, limited


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


DESK, BALL = Plane((0, 0, 1), 0.1), Sphere((0.4, 0.2, 0.5), 0.15)
BOX, BEHIND = Box((0.4, 0.2, 0.3), (0.6, 0.5, 0.7)), Box((-0.7, -0.7, 0.3), (-0.4, -0.4, 0.5))
BODY = Convex.between((-0.5, -0.4, 0.2), (-0.3, -0.2, 0.9), 0.1)
POLE = Convex.between((0.5, -0.5, 0.1), (0.5, -0.5, 0.8), 0.05)
WALLS = (Plane((1, 0, 0), -0.8), Plane((-1, 0, 0), -0.8), Plane((0, 1, 0), -0.8))
HOME = (0.1, 0.2, -0.1, 0.5, 0.2, 0.1, 0.0)


def slow(arm, velocity=0.8, torque=1.0):
    """An arm that uses a share of its limits."""
    return replace(arm, velocity_limit=velocity * arm.velocity_limit, torque_limit=torque * arm.torque_limit)


def full(arm):
    """An arm with something inside of its capsules, which are much too large."""
    capsules = filled(arm, 3).capsules
    large = replace(capsules, radius=1.4 * capsules.radius, exact=np.zeros_like(capsules.exact))
    return replace(arm, capsules=large)


def _lwr(period=16.0, home=HOME):
    return Trajectory(7, 6, period, home)


CASES = {  # of the LWR
    "desk": lambda arm: (Constraints(arm, [DESK]), Trajectory(7)),
    "no torque": lambda arm: (Constraints(slow(arm), [DESK], torque=False), _lwr(14.0)),
    "tilted floor": lambda arm: (Constraints(arm, [Plane((0.0, 0.0995037, 0.995037), 0.15)]), Trajectory(7)),
    "box": lambda arm: (Constraints(slow(arm), [DESK, BOX]), _lwr()),
    "walls": lambda arm: (Constraints(arm, [DESK, *WALLS]), _lwr(12.0, None)),
    "all": lambda arm: (Constraints(slow(arm, 0.7, 0.8), [DESK, BOX, *WALLS, BEHIND]), _lwr(20.0)),
    "bodies": lambda arm: (Constraints(arm, [DESK, BOX, BALL, BODY, POLE], clearance=0.02), _lwr()),
    "pieces": lambda arm: (Constraints(full(arm), [DESK, BALL]), Trajectory(7)),
    "pieces apart": lambda arm: (Constraints(full(arm), [DESK, BALL], clearance=0.01), Trajectory(7)),
    "acceleration": lambda arm: (Constraints(limited(arm, ["acceleration"], 0.1), [DESK, BOX]), _lwr(5.0)),
    "jerk": lambda arm: (Constraints(limited(arm, ["jerk"], 0.1), [DESK, BOX]), _lwr(5.0)),
    "friction": lambda arm: (Constraints(driven(slow(arm, torque=0.5)), [DESK]), Trajectory(7)),
    "both": lambda arm: (Constraints(limited(arm, ["acceleration", "jerk"], 0.1), [DESK, BOX]), _lwr()),
}
