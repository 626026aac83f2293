"""From a network's coefficients to those that keep each condition's position and velocity limits."""

import torch
from torch import Tensor
from torch.func import functional_call

from sidegan.conditional.condition import Condition
from sidegan.gan.limits import LimitLayer, rooms
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm

_LEAST_SHARE = 0.05  # of a joint's range, that counts as its room when sizes are compared
_POINTS = 20  # per harmonic


class Shaping:
    """The last layer of a conditional generator.

    A joint whose condition allows half the speed moves half as fast: coefficients are first brought to the
    size that suits the condition, so that the network sees the same problem under all of them, then limited.
    The reach is the mean peak of random trajectories: position from home [rad or m] and velocity, (2, J).
    """

    def __init__(self, arm: Arm, trajectory: Trajectory, reach: Tensor) -> None:
        self.arm, self.trajectory, self.reach = arm, trajectory, reach.double()
        self.layer = LimitLayer.of(arm, trajectory)
        home = torch.tensor([trajectory.home], dtype=torch.float64)
        self._usual = self._room_use(rooms(arm, home), torch.ones(1, 1), arm.velocity_limit)

    @staticmethod
    def reach_of(trajectory: Trajectory, c: Tensor) -> Tensor:
        """Mean peaks, (2, J), of trajectories with coefficients (N, J, H, 2)."""
        motion = trajectory.roll_out(c, trajectory.grid(_POINTS * trajectory.harmonics))
        moved = motion.position - c.new_tensor(trajectory.home)
        return torch.stack([x.abs().amax(1).mean(0) for x in (moved, motion.velocity)])

    def _room_use(self, room: Tensor, stretch: Tensor, speed: Tensor) -> Tensor:
        """What random trajectories would use of their tightest limit, (B, J)."""
        least = _LEAST_SHARE * (self.arm.position_upper - self.arm.position_lower)
        position = self.reach[0] * stretch / torch.maximum(room.amin(0), least)
        return torch.maximum(position, self.reach[1] / speed)

    def size(self, condition: Condition) -> Tensor:
        """Size of trajectories that suit a condition, in that of those of the family's own, (B, J)."""
        stretch = (condition.period / self.trajectory.period)[:, None]
        speed = condition.velocity[:, None] * self.arm.velocity_limit
        return self._usual / self._room_use(rooms(self.arm, condition.home), stretch, speed)

    def __call__(self, c: Tensor, condition: Condition) -> Tensor:
        """Coefficients [rad/s], (B, J, H, 2), within the limits of conditions, of the network's own."""
        stretch = (condition.period / self.trajectory.period)[:, None]
        limits = {
            "room": (rooms(self.arm, condition.home) / stretch).to(c),
            "speed": (condition.velocity[:, None] * self.arm.velocity_limit).to(c),
        }
        return functional_call(self.layer, limits, (c * self.size(condition)[:, :, None, None].to(c),))
