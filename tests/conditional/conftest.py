import pytest
import torch

from sidegan.conditional.settings import Obstacles, Ranges
from sidegan.conditional.space import ConditionSpace
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, Plane

CUBES = Obstacles((-0.8, -0.05, 0.2), (0.8, 0.05, 1.4), (0.05, 0.15))
RANGES = Ranges(
    home=0.4,
    period=(4.0, 16.0),
    velocity=(0.4, 1.0),
    torque=(0.5, 1.0),
    plane=(0.1, 0.3),
    walls=(0.4, 1.0),
    obstacle=CUBES,
    links=True,
    clearance=0.05,
    active=0.5,
)
# Changes of the ranges after which nothing can be requested.
NOTHING = {"home": 0, "period": None, "velocity": (1.0, 1.0), "torque": (1.0, 1.0), "plane": None}
NOTHING |= {"walls": None, "obstacle": None, "links": False}


def random(seed=0):
    return torch.Generator().manual_seed(seed)


@pytest.fixture(scope="session")
def constraints(planar):
    return Constraints(planar, [Plane((0, 0, 1), 0.1)])


@pytest.fixture(scope="session")
def family():
    return Trajectory(2, 3, 8.0)


@pytest.fixture(scope="session")
def space(constraints, family):
    return ConditionSpace(constraints, family, RANGES)


@pytest.fixture(scope="session")
def conditions(space):
    """Feasible conditions of every kind."""
    return space.draw(12, random())
