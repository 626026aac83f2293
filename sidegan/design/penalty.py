"""What violated constraints cost: squared relative violations."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from sidegan.kernels.limits import Limits, Near
from sidegan.motion.arrays import array
from sidegan.robot import HIGHER
from sidegan.validity import Constraints

_DISTANCE = 0.25  # [m] clearance that counts like a whole limit


@dataclass(frozen=True)
class Penalty:
    """How strongly violations count, and the share of each limit that is kept in reserve."""

    weight: float
    limits: float = 0.05  # of position, velocity, acceleration and jerk
    torque: float = 0.05
    distance: float = 0.1

    @classmethod
    def reserving(cls, weight: float, reserve: float) -> "Penalty":
        """A share of each limit, and twice that share of 0.25 m, in reserve."""
        return cls(weight, limits=reserve, torque=reserve, distance=2 * reserve)

    @property
    def reach(self) -> float:
        """Smallest distance that costs nothing [m]."""
        return self.distance * _DISTANCE

    def higher(self, constraints: Constraints, states: Sequence[Tensor]) -> tuple[Tensor, dict[int, Tensor]]:
        """What accelerations and jerks cost, summed over time, (B,), and its slopes by order, (B, T, J).

        The states are those of ``Problem.states``. A few passes over them are nothing beside the torques.
        """
        total, slopes = states[0].new_zeros(len(states[0])), {}
        for name, limit in constraints.higher.items():
            x, limit = states[HIGHER[name]], limit.to(states[0])
            beyond = (x.abs() / limit - (1 - self.limits)).clamp_min(0)
            total = total + self.weight * (beyond**2).sum((1, 2))
            slopes[HIGHER[name]] = 2 * self.weight * beyond * x.sign() / limit
        return total, slopes

    def costs(self, constraints: Constraints) -> tuple[Limits, Near | None]:
        """What limits and small distances cost, for ``RigidBody.penalised_slopes``."""
        arm = constraints.arm
        lower, upper = arm.position_lower, arm.position_upper
        torque = arm.torque_limit if constraints.torque else torch.full_like(arm.torque_limit, torch.inf)
        vectors = [(upper + lower) / 2, (upper - lower) / 2, arm.velocity_limit, torque]
        vectors.append(arm.inertial_parameters.flatten())
        limits = Limits(self.weight, self.limits, self.torque, *map(array, vectors))
        if not len(constraints.pairs) + len(constraints.guarded):
            return limits, None
        return limits, Near(self.weight / _DISTANCE**2, self.reach, constraints.shapes)
