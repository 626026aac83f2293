"""From a network's images to coefficients: unit spread, then a box and limits on motion for any input."""

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor, nn

from sidegan.base.arrays import flatten
from sidegan.errors import ShapeError
from sidegan.gan.tensors import constant
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import DERIVATIVE_ORDER, MotionLimits

_SHRINKAGE = 1e-3  # share of the mean variance added to each covariance, which few seeds leave singular
_POINTS = 24  # time points per harmonic
_SHARPNESS = 8.0  # of the saturation; a use of 1 becomes 0.92
_ROUNDING = 1e-5  # reserve for single precision
_LEAST_ROOM = 1e-3  # lower bound of the distance from home to a limit [rad or m]
_EDGE = 0.97  # share of the box to which coefficients are clipped before the inverse


class Scaling(nn.Module):
    """Images of unit spread: centred and whitened coefficients of each joint.

    Args:
        mean: mean coefficients [rad/s], (J, 2 H).
        spread: maps a joint's image to its coefficients, (J, 2 H, 2 H).
    """

    def __init__(self, mean: Tensor, spread: Tensor) -> None:
        super().__init__()
        self.mean, self.spread = nn.Buffer(mean), nn.Buffer(spread)

    @staticmethod
    def fit(c: Tensor) -> "Scaling":
        """Scaling that whitens each joint's 2 H coefficients in a seed set (N, J, H, 2)."""
        if len(c) < 2:
            raise ShapeError(f"scaling needs at least two seeds, got {len(c)}")
        x = c.flatten(2).double().transpose(0, 1)
        mean = x.mean(1)
        centred = x - mean[:, None]
        covariance = centred.transpose(1, 2) @ centred / (x.shape[1] - 1)
        floor = _SHRINKAGE * covariance.diagonal(dim1=1, dim2=2).mean(1).clamp_min(1e-12)
        eye = torch.eye(x.shape[2], dtype=torch.float64)
        values, vectors = torch.linalg.eigh(covariance + floor[:, None, None] * eye)
        return Scaling(mean, vectors @ torch.diag_embed(values.sqrt()) @ vectors.transpose(1, 2))

    def coefficients(self, image: Tensor) -> Tensor:
        """Coefficients [rad/s], (B, J, H, 2), from images (B, 2, J, H)."""
        x = image.permute(0, 2, 3, 1).flatten(2)
        c = torch.einsum("bjk,jlk->bjl", x, self.spread) + self.mean
        return c.reshape(*c.shape[:2], -1, 2)

    def image(self, c: Tensor) -> Tensor:
        """Images (B, 2, J, H) from coefficients (B, J, H, 2)."""
        x = (c.to(self.mean).flatten(2) - self.mean).transpose(0, 1)
        whitened = torch.linalg.solve(self.spread, x.transpose(1, 2)).permute(2, 0, 1)
        return whitened.reshape(c.shape).permute(0, 3, 1, 2)


class LimitLayer(nn.Module):
    """Scale coefficients so that each joint stays within its limits on motion.

    The limits are those of position, velocity and, if present, acceleration and jerk.

    A joint's motion away from home is linear in its coefficients, so scaling them scales the use of every
    limit. A joint that would use u is scaled by (1 + uᵖ)^(−1/p), which is smooth, hardly changes small
    motions, and never reaches the limit. Between samples, a signal differs from linear interpolation by at
    most dt²/8 times its largest second derivative. These derivatives are bounded in the same way, up to the
    fourth and fifth of the position, which have closed bounds. The bounds also scale with the coefficients.
    """

    def __init__(self, arm: MotionLimits, trajectory: Trajectory) -> None:
        super().__init__()
        count = _POINTS * trajectory.harmonics
        times = np.linspace(0.0, trajectory.period, count + 1)
        self.gap = trajectory.period / count
        self.orders = [1, *(DERIVATIVE_ORDER[name] for name in arm.higher_limits)]
        home = np.asarray(trajectory.home)
        # of position, velocity, acceleration and jerk, (4, T, 2 H)
        self.bases = constant(np.stack([flatten(trajectory.basis(times, order), 1) for order in range(4)]))
        # bounds of the fourth and fifth derivatives, (2, 2 H)
        self.peaks = constant(np.stack([trajectory.derivative_bound(order).ravel() for order in (4, 5)]))
        # from home to the upper and lower position limits [rad or m], (2, J)
        room = np.stack([arm.position_upper - home, home - arm.position_lower])
        self.room = constant(np.maximum(room, _LEAST_ROOM))
        # of the derivatives in ``orders``, (L, J)
        self.limits = constant(np.stack([arm.velocity_limit, *arm.higher_limits.values()]))

    def forward(self, c: Tensor) -> Tensor:
        """Scaled coefficients [rad/s], (B, J, H, 2)."""
        # exp(−softplus(p log u) / p) does not overflow.
        log = nn.functional.softplus(_SHARPNESS * torch.log(self.use(c).clamp_min(1e-12)))
        return c * ((1 - _ROUNDING) * torch.exp(-log / _SHARPNESS))[:, :, None, None]

    def use(self, c: Tensor) -> Tensor:
        """Upper bound of the share of its tightest limit that each joint uses over the period, (B, J)."""
        x, bases = c.flatten(2), self.bases.to(c)
        between = self.gap**2 / 8
        snap, crackle = (x.abs() @ peak.to(c) for peak in self.peaks)
        above, below = (_largest(side, x, bases[0]) for side in (torch.positive, torch.neg))
        peaks = {order: _largest(torch.abs, x, bases[order]) for order in (1, 2, 3)}
        bounds = peaks[2] + between * snap, peaks[3] + self.gap / 2 * snap, snap, crackle
        excess = [between * bound for bound in bounds]  # of each derivative over its samples, at most
        upper, lower = self.room.to(c)
        use = torch.maximum((above + excess[0]) / upper, (below + excess[0]) / lower)
        for order, limit in zip(self.orders, self.limits.to(c)):
            use = torch.maximum(use, (peaks[order] + excess[order]) / limit)
        return use


class CoefficientBox(nn.Module):
    """Map free coefficients smoothly into a box of absolute values below a size [rad/s]."""

    def __init__(self, size: float) -> None:
        super().__init__()
        self.size = size

    def forward(self, free: Tensor) -> Tensor:
        """Coefficients [rad/s], (B, J, H, 2), from free ones; those far inside the box hardly change."""
        return (1 - _ROUNDING) * self.size * torch.tanh(free / self.size)

    def free(self, c: Tensor) -> Tensor:
        """Free coefficients [rad/s], (B, J, H, 2), from those in the box, clipped at its edge."""
        return self.size * torch.atanh((c / self.size).clamp(-_EDGE, _EDGE))


def _largest(size: Callable[[Tensor], Tensor], x: Tensor, basis: Tensor) -> Tensor:
    """Largest size over time, (B, J), of motions with coefficients x (B, J, 2 H).

    Its gradient is that of the peak: through all times, it would cost as much as all else in the layer.
    """
    with torch.no_grad():
        peak = size(x @ basis.T).argmax(2)
    return size((x * basis[peak]).sum(2))
