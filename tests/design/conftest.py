"""Problems, matrices, trajectories and an oracle that tests of the room share."""

import math

import pytest
import torch

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
    return torch.Generator().manual_seed(3)


def states_of(problem, c):
    """Positions and as many derivatives as are limited at a problem's samples, (B, T, J) each."""
    family, times = problem.trajectory, problem.trajectory.grid(problem.samples)
    return [family.derivative(c, times, order) for order in range(problem.constraints.orders)]


def semidefinite(seed, count=1, size=4, rank=6):
    """Random matrices of a rank, (count, size, size)."""
    rows = torch.randn(count, rank, size, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    return rows.mT @ rows


def trajectories(joints, batch=6):
    """A family, and some of it."""
    trajectory = Trajectory(joints, 4, 8.0)
    c = torch.randn(batch, *trajectory.shape, generator=torch.Generator().manual_seed(5), dtype=torch.float64)
    return trajectory, 0.3 * c


def assert_slopes(function, c, random, **near):
    """The gradient (…) of value (B,) or () is that of central differences; the value."""
    direction = torch.randn(c.shape, generator=random, dtype=torch.float64)
    up, down = (function(c + step * direction)[0] for step in (1e-6, -1e-6))
    value, gradient = function(c)
    slope = (gradient * direction).flatten(value.dim()).sum(-1)
    torch.testing.assert_close((up - down) / 2e-6, slope, **near)
    return value


def by_autograd(function):
    """Value and gradient of a function that torch differentiates."""

    def both(c):
        c = c.clone().requires_grad_(True)
        value = function(c)
        return value.detach(), torch.autograd.grad(value, c)[0]

    return both


def log_condition(x):
    """Logarithm of the smooth largest over the smooth smallest of values, ascending, (B, p) → (B,)."""
    positive = x[:, -1:] > 0
    values = torch.where(positive, torch.maximum(x, x[:, -1:] / HOPELESS), 1.0)
    low, high = values[:, :LOWEST].log(), values[:, -HIGHEST:].log()
    ends = torch.logsumexp(-SHARPNESS * low, 1) + torch.logsumexp(SHARPNESS * high, 1)
    return torch.where(positive[:, 0], ends / SHARPNESS, math.log(HOPELESS))
