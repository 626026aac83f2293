import pytest
import torch

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
    return torch.Generator().manual_seed(3)
