"""A last layer after which all limits on motion hold over the whole period, whatever it is given."""

from collections.abc import Mapping

import torch
from torch import Tensor, nn

from sidegan.errors import ShapeError
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import HIGHER, Arm

_POINTS = 24  # time points per harmonic
_SHARPNESS = 8.0  # of the turn from proportional to saturated; use 1 becomes 0.92
_ROUNDING = 1e-5  # of single precision, kept free
_LEAST_ROOM = 1e-3  # [rad or m] below which a joint whose home lies at its limit stands still


class LimitLayer(nn.Module):
    """Coefficients of which each joint uses less than the whole of its limits on motion.

    Those are the limits of position, velocity and, where there are any, of acceleration and jerk.

    A joint's motion away from home is linear in its coefficients, so scaling them scales what is used of
    every limit; a joint that would use u is scaled by (1 + uᵖ)^(−1/p), which is smooth, leaves small
    motions alone, and never reaches the limit. Between samples a signal lies within dt²/8 of its largest
    second derivative of the line through its neighbours; those derivatives are bounded likewise, up to the
    fourth of the position, which has a closed form, as the fifth has. The bound scales with the coefficients
    too.

    Args:
        trajectory: the family of trajectories.
        room: from home to the upper and to the lower position limits [rad or m], (2, J), positive.
        speed: velocity limits [rad/s], (J,).
        inverse: one over the limits of acceleration and jerk, (J,), zero for joints without; by name.
    """

    bases: Tensor  # (4, T, 2 H)
    snap: Tensor  # bounds of the fourth derivative, (2 H,)
    crackle: Tensor  # and of the fifth
    room: Tensor
    speed: Tensor

    def __init__(
        self, trajectory: Trajectory, room: Tensor, speed: Tensor, inverse: Mapping[str, Tensor] | None = None
    ) -> None:
        super().__init__()
        joints, inverse = trajectory.joints, inverse or {}
        sizes = [x.shape == (joints,) for x in (speed, *inverse.values())]
        if room.shape != (2, joints) or not all(sizes) or not (room > 0).all():
            shapes = f"room {tuple(room.shape)} and speed {tuple(speed.shape)}"
            raise ShapeError(f"{shapes}, expected (2, {joints}) and ({joints},), all positive")
        count = _POINTS * trajectory.harmonics
        times = torch.linspace(0.0, trajectory.period, count + 1, dtype=torch.float64)
        self.gap = trajectory.period / count
        bases = torch.stack([trajectory.basis(times, order).flatten(1) for order in range(4)])
        snap, crackle = (trajectory.derivative_bound(order).flatten() for order in (4, 5))
        for name, value in {"bases": bases, "snap": snap, "crackle": crackle}.items():
            self.register_buffer(name, value.float(), persistent=False)
        self.higher = tuple(inverse)
        limits = {"room": room, "speed": speed} | {f"inverse_{name}": x for name, x in inverse.items()}
        for name, value in limits.items():
            self.register_buffer(name, value.float())

    @classmethod
    def of(cls, arm: Arm, trajectory: Trajectory) -> "LimitLayer":
        """Limits of an arm around the home of a family of trajectories."""
        if trajectory.joints != arm.joints:
            raise ShapeError(f"trajectories of {trajectory.joints} joints for an arm of {arm.joints}")
        inverse = {name: 1 / limit for name, limit in arm.higher_limits.items()}
        room = rooms(arm, torch.tensor(trajectory.home).double())
        return cls(trajectory, room, arm.velocity_limit, inverse)

    @property
    def inverse(self) -> dict[str, Tensor]:
        """One over the limits of acceleration and jerk, (J,), by name."""
        return {name: getattr(self, f"inverse_{name}") for name in self.higher}

    def forward(self, c: Tensor) -> Tensor:
        """Scaled coefficients [rad/s], (B, J, H, 2)."""
        # exp(−softplus(p log u) / p), which overflows nowhere.
        turn = nn.functional.softplus(_SHARPNESS * torch.log(self.use(c).clamp_min(1e-12)))
        return c * ((1 - _ROUNDING) * torch.exp(-turn / _SHARPNESS))[:, :, None, None]

    def use(self, c: Tensor) -> Tensor:
        """Upper bound of the share of its tightest limit that each joint uses in the period, (B, J)."""
        x = c.flatten(2)
        q, dq, *higher = (x @ basis.to(c).T for basis in self.bases)
        ddq, jerk = higher
        snap = x.abs() @ self.snap.to(c)
        jerk_bound = jerk.abs().amax(2) + self.gap / 2 * snap
        acceleration_bound = ddq.abs().amax(2) + self.gap**2 / 8 * snap
        shift, slip = self.gap**2 / 8 * acceleration_bound, self.gap**2 / 8 * jerk_bound
        upper, lower = self.room.to(c)
        position = torch.maximum((q.amax(2) + shift) / upper, (shift - q.amin(2)) / lower)
        use = torch.maximum(position, (dq.abs().amax(2) + slip) / self.speed.to(c))
        bounds = {"acceleration": snap, "jerk": x.abs() @ self.crackle.to(c)}
        for name, inverse in self.inverse.items():
            peak = higher[HIGHER[name] - 2].abs().amax(2) + self.gap**2 / 8 * bounds[name]
            use = torch.maximum(use, peak * inverse.to(c))
        return use


def rooms(arm: Arm, home: Tensor) -> Tensor:
    """Room from a home (…, J) to the upper and to the lower position limits [rad or m], (2, …, J)."""
    return torch.stack([arm.position_upper - home, home - arm.position_lower]).clamp_min(_LEAST_ROOM)
