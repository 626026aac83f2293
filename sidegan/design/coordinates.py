"""Coordinates in which a random trajectory uses all of its limits and all directions cost alike."""

from dataclasses import dataclass

import torch
from torch import Tensor

from sidegan.design.problem import Problem
from sidegan.robot import DERIVATIVE_ORDER

_POINTS = 20  # per harmonic, for the means over time


@dataclass(frozen=True)
class Coordinates:
    """A linear map per joint from x, (B, J, 2 H), to coefficients [rad/s], (B, J, H, 2).

    The quintic that brings a joint to rest ties its coefficients together: most changes of a single one
    move the arm far, few combinations hardly at all. At 560 s and 210 harmonics a random draw of
    coefficients is nearly all quintic. In natural coordinates |x|² is the mean square of position and
    velocity, and of acceleration and jerk where they are limited, as shares of their limits, plus that of the
    coefficients over the velocity limit, which keeps the combinations that hardly move the arm small.
    """

    matrix: Tensor  # symmetric, (J, 2 H, 2 H); c = matrix @ x

    @classmethod
    def of(cls, problem: Problem) -> "Coordinates":
        """Natural coordinates of a problem's trajectories."""
        arm, trajectory = problem.constraints.arm, problem.trajectory
        times = trajectory.grid(_POINTS * trajectory.harmonics)
        position, velocity = (trajectory.basis(times, order).flatten(1) for order in (0, 1))
        room = ((arm.position_upper - arm.position_lower) / 2)[:, None, None]
        speed = arm.velocity_limit[:, None, None]
        unit = torch.eye(2 * trajectory.harmonics, dtype=torch.float64)
        metric = position.T @ position / len(times) / room**2
        metric = metric + (velocity.T @ velocity / len(times) + unit) / speed**2
        for name, limit in problem.constraints.higher.items():
            x = trajectory.basis(times, DERIVATIVE_ORDER[name]).flatten(1)
            metric = metric + x.T @ x / len(times) / limit[:, None, None] ** 2
        values, vectors = torch.linalg.eigh(metric)
        return cls(vectors @ (vectors / values.sqrt()[:, None]).transpose(1, 2))

    def coefficients(self, x: Tensor) -> Tensor:
        """Coefficients [rad/s], (B, J, H, 2), of points (B, J, 2 H)."""
        c = torch.einsum("jkl,bjl->bjk", self.matrix, x)
        return c.unflatten(2, (-1, 2))

    def points(self, c: Tensor) -> Tensor:
        """Points (B, J, 2 H) of coefficients [rad/s], (B, J, H, 2)."""
        x = torch.linalg.solve(self.matrix, c.flatten(2).double().transpose(0, 1).transpose(1, 2))
        return x.permute(2, 0, 1)

    def start(self, problem: Problem, count: int, generator: torch.Generator, reach: float) -> Tensor:
        """Random points, (count, J, 2 H), each joint using ``reach`` of its tightest limit."""
        joints, size, _ = self.matrix.shape
        x = torch.randn(count, joints, size, generator=generator, dtype=torch.float64)
        use = problem.limit_use(self.coefficients(x))
        return x * (reach / use)[:, :, None]
