"""The seed optimisation problem: make YᵀY well conditioned, inside all constraints."""

from dataclasses import dataclass

import torch
from torch import Tensor

from sidegan.dynamics import RigidBody, gram
from sidegan.excitation import Excitation, excitation_of
from sidegan.trajectory import Motion, Trajectory
from sidegan.validity import Constraints
from sidegan.validity.bounds import Slack, cell_motion

HOPELESS = 1e12  # stands for an infinite condition number: optimisers take finite numbers only


@dataclass(frozen=True)
class SeedProblem:
    """Condition number and constraints of trajectories of one arm.

    Args:
        constraints: the arm and its workspace.
        trajectory: the family of trajectories.
        samples: time points per period at which the objective and the constraints are taken.
        diagonal: optimise the diagonal fitness instead of the eigenvalue fitness.
    """

    constraints: Constraints
    trajectory: Trajectory
    samples: int = 80
    diagonal: bool = False

    @property
    def body(self) -> RigidBody:
        """Dynamics of the arm."""
        return self.constraints.body

    def start(self, count: int, generator: torch.Generator, reach: float = 0.7) -> Tensor:
        """Random coefficients [rad/s], (count, J, H, 2), that use ``reach`` of the tightest joint limit."""
        c = torch.randn(count, *self.trajectory.shape, generator=generator, dtype=torch.float64)
        return c * (reach / self.limit_use(c))[:, None, None, None]

    def limit_use(self, c: Tensor) -> Tensor:
        """Largest share of a position or velocity limit that each trajectory uses, (B,)."""
        arm = self.constraints.arm
        motion = self.trajectory.roll_out(c, self.trajectory.grid(4 * self.samples))
        home = c.new_tensor(self.trajectory.home)
        room = torch.minimum(arm.position_upper - home, home - arm.position_lower).clamp_min(1e-6)
        position = ((motion.position - home).abs() / room).amax((1, 2))
        velocity = (motion.velocity.abs() / arm.velocity_limit).amax((1, 2))
        return torch.maximum(position, velocity).clamp_min(1e-9)

    def motion(self, c: Tensor) -> Motion:
        """Joint motion at the problem's time points, (B, samples, J)."""
        return self.trajectory.roll_out(c, self.trajectory.grid(self.samples))

    def excitation(self, c: Tensor) -> Excitation:
        """Excitation at the problem's time points, without gradient."""
        with torch.no_grad():
            return excitation_of(self.body, gram(self.body, self.trajectory, c, self.samples))

    def fitness(self, c: Tensor) -> Tensor:
        """The number to minimise, (B,), capped to stay finite."""
        excitation = self.excitation(c)
        value = excitation.diagonal_fitness if self.diagonal else excitation.eigenvalue_fitness
        return value.nan_to_num(HOPELESS, HOPELESS).clamp_max(HOPELESS)
