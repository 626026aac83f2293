"""The roll-out as a fixed first layer of networks that see trajectories over time."""

import math

import numpy as np
import torch
from torch import Tensor, nn

from sidegan.base.arrays import flatten
from sidegan.gan.tensors import tensor
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import DERIVATIVE_ORDER, Arm

_PEAKS = 4  # finer time points per step for the use of limits, to catch peaks
_POINTS = 4  # time points per harmonic in corrections
_ACCELERATION = 5.0  # unit of accelerations [rad/s²]


class RollOut(nn.Module):
    """Maps coefficients (B, J, H, 2) to channels (B, 5 J + L, T), float32, without weights.

    The channels are sin and cos of the positions, the used shares of the position and velocity ranges, scaled
    accelerations, and the largest share over the joints of each of the L kinds of limits that are linear in
    the coefficients: position, velocity and, if present, acceleration and jerk.
    """

    basis: Tensor
    home: Tensor
    middle: Tensor
    room: Tensor
    speed: Tensor

    def __init__(self, arm: Arm, trajectory: Trajectory, steps: int) -> None:
        super().__init__()
        self.steps = steps
        self.higher = tuple(arm.higher_limits)
        self.linear = 2 + len(self.higher)
        self.channels = 5 * arm.joints + self.linear
        times = trajectory.grid(steps * _PEAKS)
        orders = range(4 if self.higher else 3)
        buffers = {
            "basis": np.stack([flatten(trajectory.basis(times, order), 1) for order in orders]),
            "home": np.array(trajectory.home),
            "middle": (arm.position_upper + arm.position_lower) / 2,
            "room": (arm.position_upper - arm.position_lower) / 2,
            "speed": arm.velocity_limit,
            **arm.higher_limits,
        }
        for name, value in buffers.items():
            self.register_buffer(name, tensor(value).float(), persistent=False)

    def forward(self, c: Tensor) -> Tensor:
        """Channels (B, 5 J + L, T)."""
        motion = torch.einsum("dtk,bjk->dbjt", self.basis, c.flatten(2))
        q = motion[0] + self.home[:, None]
        used = (q - self.middle[:, None]) / self.room[:, None]
        rate = motion[1] / self.speed[:, None]
        shares = [motion[DERIVATIVE_ORDER[name]] / getattr(self, name)[:, None] for name in self.higher]
        tightest = [x.abs().amax(1, keepdim=True) for x in (used, rate, *shares)]
        peaks = [nn.functional.max_pool1d(x, _PEAKS) for x in tightest]
        q, used, rate, ddq = (x[..., ::_PEAKS] for x in (q, used, rate, motion[2]))
        return torch.cat([torch.sin(q), torch.cos(q), used, rate, ddq / _ACCELERATION, *peaks], 1)


class Correction(nn.Module):
    """Corrections of images (B, 2, J, H), from the images and their roll-out; initially zero.

    The worth of a joint's motion depends on the other joints' positions at that time, which the roll-out
    shows: the network learns the step that an optimiser would take.
    """

    def __init__(self, arm: Arm, trajectory: Trajectory, width: int) -> None:
        super().__init__()
        size = math.prod(trajectory.shape)
        steps = _POINTS * trajectory.harmonics
        self.roll_out = RollOut(arm, trajectory, steps)
        inputs = size + steps * self.roll_out.channels
        last = nn.Linear(width, size)
        nn.init.zeros_(last.weight)
        nn.init.zeros_(last.bias)
        hidden = [nn.Linear(inputs, width), nn.ReLU(), nn.Linear(width, width), nn.ReLU()]
        self.layers = nn.Sequential(*hidden, last)

    def forward(self, images: Tensor, c: Tensor) -> Tensor:
        """Corrections of images (B, 2, J, H) of trajectories with coefficients c [rad/s]."""
        seen = torch.cat([images.flatten(1), self.roll_out(c).flatten(1)], 1)
        return self.layers(seen).view_as(images)
