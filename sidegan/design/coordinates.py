"""Coordinates in which random trajectories use all limits, and all directions cost the same."""

from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array, flatten
from sidegan.design.problem import Problem
from sidegan.robot import DERIVATIVE_ORDER

_POINTS = 20  # per harmonic, for the means over time


@dataclass(frozen=True)
class Coordinates:
    """A linear map per joint from x, (B, J, 2 H), to coefficients [rad/s], (B, J, H, 2).

    The quintic that brings a joint to rest couples its coefficients: most changes of a single coefficient
    move the arm far, a few combinations hardly at all. At 560 s and 210 harmonics, random coefficients give
    almost only the quintic. In natural coordinates |x|² is the mean square of position and velocity, and of
    acceleration and jerk if limited, relative to their limits, plus that of the coefficients over the
    velocity limit, which bounds the combinations that hardly move the arm.
    """

    matrix: Array  # symmetric, (J, 2 H, 2 H); c = matrix @ x

    @classmethod
    def of(cls, problem: Problem) -> "Coordinates":
        """Natural coordinates of a problem's trajectories."""
        arm = problem.constraints.arm
        trajectory = problem.trajectory
        times = trajectory.grid(_POINTS * trajectory.harmonics)
        position, velocity = (flatten(trajectory.basis(times, order), 1) for order in (0, 1))
        room = ((arm.position_upper - arm.position_lower) / 2)[:, None, None]
        speed = arm.velocity_limit[:, None, None]
        unit = np.eye(2 * trajectory.harmonics)
        metric = position.T @ position / len(times) / room**2
        metric = metric + (velocity.T @ velocity / len(times) + unit) / speed**2
        for name, limit in problem.constraints.higher.items():
            x = flatten(trajectory.basis(times, DERIVATIVE_ORDER[name]), 1)
            metric = metric + x.T @ x / len(times) / limit[:, None, None] ** 2
        values, vectors = np.linalg.eigh(metric)
        return cls(vectors @ (vectors / np.sqrt(values)[:, None]).mT)

    def coefficients(self, x: Array) -> Array:
        """Coefficients [rad/s], (B, J, H, 2), from points (B, J, 2 H)."""
        c = (x.swapaxes(0, 1) @ self.matrix.mT).swapaxes(0, 1)
        return c.reshape(*c.shape[:2], c.shape[2] // 2, 2)

    def points(self, c: Array) -> Array:
        """Points (B, J, 2 H) from coefficients [rad/s], (B, J, H, 2)."""
        return np.linalg.solve(self.matrix, flatten(c, 2).transpose(1, 2, 0)).transpose(2, 0, 1)

    def start(self, problem: Problem, count: int, generator: np.random.Generator, reach: float) -> Array:
        """Random points, (count, J, 2 H), each joint using ``reach`` of its tightest limit."""
        joints, size, _ = self.matrix.shape
        x = generator.standard_normal((count, joints, size))
        use = problem.limit_use(self.coefficients(x))
        return x * (reach / use)[:, :, None]
