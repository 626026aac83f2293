"""Last layers after which a limit holds whatever they are given: limits on motion, a box of coefficients."""

import numpy as np
import torch
from torch import Tensor, nn

from sidegan.base.arrays import flatten
from sidegan.gan.tensors import tensor
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import DERIVATIVE_ORDER, Arm

_POINTS = 24  # time points per harmonic
_SHARPNESS = 8.0  # of the turn from proportional to saturated; use 1 becomes 0.92
_ROUNDING = 1e-5  # of single precision, kept free
_LEAST_ROOM = 1e-3  # [rad or m] below which a joint whose home lies at its limit stands still
_EDGE = 0.97  # of a box, as which what lies on it, or beyond, counts when it is taken out


class LimitLayer(nn.Module):
    """Coefficients of which each joint uses less than the whole of its limits on motion.

    Those are the limits of position, velocity and, where there are any, of acceleration and jerk.

    A joint's motion away from home is linear in its coefficients, so scaling them scales what is used of
    every limit; a joint that would use u is scaled by (1 + uᵖ)^(−1/p), which is smooth, leaves small
    motions alone, and never reaches the limit. Between samples a signal lies within dt²/8 of its largest
    second derivative of the line through its neighbours; those derivatives are bounded likewise, up to the
    fourth of the position, which has a closed form, as the fifth has. The bound scales with the coefficients
    too.
    """

    bases: Tensor  # of position, velocity, acceleration and jerk, (4, T, 2 H)
    peaks: Tensor  # bounds of the fourth and of the fifth derivative, (2, 2 H)
    room: Tensor  # from home to the upper and to the lower position limits [rad or m], (2, J)
    limits: Tensor  # of the derivatives in ``orders``, (L, J)

    def __init__(self, arm: Arm, trajectory: Trajectory) -> None:
        super().__init__()
        count = _POINTS * trajectory.harmonics
        times = np.linspace(0.0, trajectory.period, count + 1)
        self.gap = trajectory.period / count
        self.orders = [1, *(DERIVATIVE_ORDER[name] for name in arm.higher_limits)]
        home = np.asarray(trajectory.home)
        room = np.stack([arm.position_upper - home, home - arm.position_lower])
        buffers = {
            "bases": np.stack([flatten(trajectory.basis(times, order), 1) for order in range(4)]),
            "peaks": np.stack([trajectory.derivative_bound(order).ravel() for order in (4, 5)]),
            "room": np.maximum(room, _LEAST_ROOM),
            "limits": np.stack([arm.velocity_limit, *arm.higher_limits.values()]),
        }
        for name, value in buffers.items():
            self.register_buffer(name, tensor(value).float(), persistent=False)

    def forward(self, c: Tensor) -> Tensor:
        """Scaled coefficients [rad/s], (B, J, H, 2)."""
        # exp(−softplus(p log u) / p), which overflows nowhere.
        turn = nn.functional.softplus(_SHARPNESS * torch.log(self.use(c).clamp_min(1e-12)))
        return c * ((1 - _ROUNDING) * torch.exp(-turn / _SHARPNESS))[:, :, None, None]

    def use(self, c: Tensor) -> Tensor:
        """Upper bound of the share of its tightest limit that each joint uses in the period, (B, J)."""
        x, between = c.flatten(2), self.gap**2 / 8
        motion = [x @ basis.to(c).T for basis in self.bases]
        snap, crackle = (x.abs() @ peak.to(c) for peak in self.peaks)
        acceleration = motion[2].abs().amax(2) + between * snap
        jerk = motion[3].abs().amax(2) + self.gap / 2 * snap
        beyond = [between * bound for bound in (acceleration, jerk, snap, crackle)]  # samples, by order
        upper, lower = self.room.to(c)
        q = motion[0]
        use = torch.maximum((q.amax(2) + beyond[0]) / upper, (beyond[0] - q.amin(2)) / lower)
        for order, limit in zip(self.orders, self.limits.to(c)):
            use = torch.maximum(use, (motion[order].abs().amax(2) + beyond[order]) / limit)
        return use


class Box(nn.Module):
    """Coefficients of absolute values below a size [rad/s]."""

    def __init__(self, size: float) -> None:
        super().__init__()
        self.size = size

    def forward(self, free: Tensor) -> Tensor:
        """Coefficients [rad/s], (B, J, H, 2), of free ones; those far within the box are left alone."""
        return (1 - _ROUNDING) * self.size * torch.tanh(free / self.size)

    def free(self, c: Tensor) -> Tensor:
        """Free coefficients [rad/s], (B, J, H, 2), that become nearly those in the box."""
        return self.size * torch.atanh((c / self.size).clamp(-_EDGE, _EDGE))
