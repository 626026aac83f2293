"""Networks that correct a trajectory by what it does over time."""

import math

import torch
from torch import Tensor, nn

from sidegan.gan.rollout import RollOut
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm

_POINTS = 4  # time points per harmonic


class Correction(nn.Module):
    """Changes of images (B, 2, J, H), by the images and the roll-out of their trajectories; none at first.

    What a joint's motion is worth depends on where the others are at that time, which coefficients hide and
    positions show: it learns the step that an optimiser would take from there.
    """

    def __init__(self, arm: Arm, trajectory: Trajectory, width: int) -> None:
        super().__init__()
        size, steps = math.prod(trajectory.shape), _POINTS * trajectory.harmonics
        self.roll_out = RollOut(arm, trajectory, steps)
        inputs = size + steps * self.roll_out.channels
        last = nn.Linear(width, size)
        nn.init.zeros_(last.weight)
        nn.init.zeros_(last.bias)
        hidden = [nn.Linear(inputs, width), nn.ReLU(), nn.Linear(width, width), nn.ReLU()]
        self.layers = nn.Sequential(*hidden, last)

    def forward(self, images: Tensor, c: Tensor) -> Tensor:
        """Changes of images (B, 2, J, H) of trajectories with coefficients c [rad/s]."""
        seen = torch.cat([images.flatten(1), self.roll_out(c).flatten(1)], 1)
        return self.layers(seen).view_as(images)
