"""Generator and discriminator, four dense layers on (2, J, H) images, and the roll-out of trajectories."""

import math
from itertools import pairwise
from typing import cast

import numpy as np
import torch
from torch import Tensor, nn

from sidegan.base.arrays import flatten
from sidegan.gan.tensors import constant
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import DERIVATIVE_ORDER, MotionLimits

_SMALL = 0.1  # initial scale of the layers next to the shortcut
_DRAWS = 1024  # samples for the layers' mean
_PEAKS = 4  # finer time points per step for the use of limits, to catch peaks
_POINTS = 2  # time points per harmonic in corrections
_ACCELERATION = 5.0  # unit of accelerations [rad/s²]


class FromNoise(nn.Module):
    """A network that maps noise (B, Z), uniform in [−1, 1], to images."""

    noise: int  # Z
    settings: dict[str, int]  # constructor arguments
    layers: nn.Sequential

    def draw(self, count: int, stream: torch.Generator | None = None) -> Tensor:
        """Noise (count, Z) on the network's device, of torch's own random numbers if there is no stream."""
        parameter = next(self.parameters())
        z = torch.rand(count, self.noise, generator=stream, dtype=parameter.dtype)
        return (2 * z - 1).to(parameter.device)

    def forward(self, z: Tensor) -> Tensor:
        """Images (B, 2, …)."""
        return self.layers(z)

    def sample(self, count: int, stream: torch.Generator | None = None) -> Tensor:
        """Images of new noise, (count, …)."""
        return self(self.draw(count, stream))


class DenseGenerator(FromNoise):
    """Maps noise (B, Z) in [−1, 1] to images (B, 2, J, H); its layers initially yield unit spread.

    A shortcut is a linear path parallel to the layers, which ``start_from`` sets.
    """

    def __init__(
        self, joints: int, harmonics: int, noise: int = 100, width: int = 256, shortcut: bool = False
    ) -> None:
        super().__init__()
        self.noise = noise
        sizes = {"joints": joints, "harmonics": harmonics, "noise": noise, "width": width}
        self.settings = {**sizes, "shortcut": shortcut}
        self.shape = (2, joints, harmonics)
        size = 2 * joints * harmonics
        self.shortcut = nn.Linear(noise, size) if shortcut else None
        hidden, last = _hidden(noise, width, width, width), nn.Linear(width, size)
        self.layers = nn.Sequential(*hidden, last, nn.Unflatten(1, self.shape))
        with torch.no_grad():
            last.weight /= self.layers(self.draw(256)).std(0).mean()
            last.bias.zero_()

    def forward(self, z: Tensor) -> Tensor:
        """Images (B, 2, J, H)."""
        image = self.layers(z)
        return image if self.shortcut is None else image + self.shortcut(z).view(-1, *self.shape)

    @torch.no_grad()
    def start_from(self, images: Tensor) -> None:
        """Initialise a network with a shortcut to the mean and covariance of images (N, 2, J, H).

        The layers' output becomes small. Noise dimensions beyond the image's only enter the layers; with
        fewer dimensions, the shortcut keeps the leading principal directions.
        """
        shortcut, last = cast("nn.Linear", self.shortcut), cast("nn.Linear", self.layers[-2])
        x = images.flatten(1).double()
        values, vectors = torch.linalg.eigh(torch.cov(x.T))
        count = min(self.noise, x.shape[1])
        # Noise that is uniform on [−1, 1] has variance 1/3.
        root = vectors[:, -count:] * (3 * values[-count:].clamp_min(0)).sqrt()
        shortcut.weight.zero_()
        shortcut.weight[:, :count] = root.to(shortcut.weight)
        last.weight *= _SMALL
        output = self.layers(self.draw(_DRAWS, torch.Generator().manual_seed(0)))
        shortcut.bias.copy_(x.mean(0) - output.flatten(1).mean(0))


class Discriminator(nn.Module):
    """Logits (B,) of being an example, for images (B, 2, J, H) or standardised features (B, p).

    Beside each sample it sees the spread of the batch, so that a batch of equal samples is told apart.

    Source: Karras et al. 2018, Progressive growing of GANs (the standard deviation over a minibatch).
    """

    def __init__(self, inputs: int, width: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(*_hidden(2 * inputs, width, width, width), nn.Linear(width, 1))

    def forward(self, x: Tensor) -> Tensor:
        """Logits (B,)."""
        x = x.flatten(1)
        spread = x.std(0, keepdim=True).expand_as(x)
        return self.layers(torch.cat([x, spread], 1))[:, 0]


def _hidden(*sizes: int) -> list[nn.Module]:
    """Dense layers from each size to the next, each with a ReLU."""
    return [module for a, b in pairwise(sizes) for module in (nn.Linear(a, b), nn.ReLU())]


class RollOut(nn.Module):
    """Maps coefficients (B, J, H, 2) to channels (B, 5 J + L, T), float32, without weights.

    The channels are sin and cos of the positions, the used shares of the position and velocity ranges, scaled
    accelerations, and the largest share over the joints of each of the L kinds of limits that are linear in
    the coefficients: position, velocity and, if present, acceleration and jerk.
    """

    def __init__(self, arm: MotionLimits, trajectory: Trajectory, steps: int) -> None:
        super().__init__()
        self.steps = steps
        self.orders = [1, *(DERIVATIVE_ORDER[name] for name in arm.higher_limits)]
        self.limit_kinds = 1 + len(self.orders)
        self.channels = 5 * arm.joints + self.limit_kinds
        times = trajectory.grid(steps * _PEAKS)
        fine = np.stack([flatten(trajectory.basis(times, order), 1) for order in range(4)])
        # basis of the positions and of the derivatives in ``orders``, (L, P T, 2 H), and of the accelerations
        self.basis = constant(fine[[0, *self.orders]])
        self.acceleration = constant(fine[2, ::_PEAKS])
        self.home = constant(np.array(trajectory.home))
        self.middle = constant((arm.position_upper + arm.position_lower) / 2)
        self.room = constant((arm.position_upper - arm.position_lower) / 2)
        self.limits = constant(np.stack([arm.velocity_limit, *arm.higher_limits.values()]))  # of ``orders``

    def forward(self, c: Tensor) -> Tensor:
        """Channels (B, 5 J + L, T)."""
        x = c.flatten(2)
        motion = (x @ self.basis.flatten(0, 1).T).unflatten(2, (self.limit_kinds, -1))
        q, *rates = motion.unbind(2)
        q = q + self.home[:, None]
        used = (q - self.middle[:, None]) / self.room[:, None]
        rates = [rate / limit[:, None] for rate, limit in zip(rates, self.limits)]
        shares = [rate.abs().amax(1, keepdim=True) for rate in (used, *rates)]
        peaks = [share.unflatten(2, (-1, _PEAKS)).amax(3) for share in shares]
        q, used, rate = (y[..., ::_PEAKS] for y in (q, used, rates[0]))
        ddq = x @ self.acceleration.T / _ACCELERATION
        return torch.cat([torch.sin(q), torch.cos(q), used, rate, ddq, *peaks], 1)


class Correction(nn.Module):
    """Corrections of images (B, 2, J, H), from the images and their roll-out; initially zero.

    The worth of a joint's motion depends on the other joints' positions at that time, which the roll-out
    shows: the network learns the step that an optimiser would take.
    """

    def __init__(self, arm: MotionLimits, trajectory: Trajectory, width: int) -> None:
        super().__init__()
        size = math.prod(trajectory.shape)
        steps = _POINTS * trajectory.harmonics
        self.roll_out = RollOut(arm, trajectory, steps)
        inputs = size + steps * self.roll_out.channels
        last = nn.Linear(width, size)
        nn.init.zeros_(last.weight)
        nn.init.zeros_(last.bias)
        self.layers = nn.Sequential(*_hidden(inputs, width, width), last)

    def forward(self, images: Tensor, c: Tensor) -> Tensor:
        """Corrections of images (B, 2, J, H) of trajectories with coefficients c [rad/s]."""
        seen = torch.cat([images.flatten(1), self.roll_out(c).flatten(1)], 1)
        return self.layers(seen).view_as(images)
