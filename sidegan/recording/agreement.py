"""How a recording agrees with the arm's description: velocities, signs of torques, late signals."""

import math
from typing import NamedTuple

import torch
from torch import Tensor

from sidegan.errors import RecordingError
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.excitation import friction_columns
from sidegan.recording.recording import SIGN_WIDTH, Segment
from sidegan.recording.statistics import Statistics
from sidegan.robot import Arm

_DEGREES = 180 / math.pi
_SAMPLES = 20_000  # enough to tell a sign
_CLEAR = 0.4  # correlation with the model that says something
_LONGEST_LAG = 0.25  # [s]
_BETTER = 0.8  # share of the squared residual that is left when a lag is believed
_NEAR = 0.3  # of the logarithm of a ratio
_WRONG_SLOPE = 0.1  # of a velocity over the derivative of its position
_TINY = 1e-12


class Agreement(NamedTuple):
    """Agreement of the measured torque with the arm's description.

    Attributes:
        sign: correlation of both without what friction and rotor inertia can explain, −1 to 1, (J,). Near −1
            the torque is counted the other way round; near 0 the motion does not tell.
        friction: share of the power that friction dissipates, (J,); negative where the torque would drive the
            arm's friction.
        lag: time by which torques are later than states [s].
        late: whether the lag is believed.
    """

    sign: Tensor
    friction: Tensor
    lag: float
    late: bool

    def warnings(self, arm: Arm) -> list[str]:
        """Joints whose torque looks reversed, or whose sign the motion does not tell, and the lag."""
        against, silent = self.sign < -_CLEAR, self.sign.abs() < _CLEAR
        reversed_ = arm_names(arm, against & (self.friction < _CLEAR))
        warnings = []
        if reversed_:
            warnings.append(
                f"the torque of {', '.join(reversed_)} runs against the description: is its sign wrong? "
                f"(recording.reverse=[{','.join(reversed_)}])"
            )
        if silent.any():
            warnings.append(
                "the motion does not tell whether the sign of the torque of "
                f"{', '.join(arm_names(arm, silent))} is right"
            )
        if self.late:
            when = "later" if self.lag > 0 else "earlier"
            warnings.append(f"torques look {abs(self.lag) * 1e3:.0f} ms {when} than the states")
        return warnings


def agreement_of(body: RigidBody, segments: list[Segment]) -> Agreement:
    """Agreement of segments with an arm's description."""
    return Agreement(*_signs(body, segments), *_lag(body, segments))


def velocity_warnings(statistics: Statistics, arm: Arm, segments: list[Segment]) -> list[str]:
    """What is odd about recorded velocities, beside the derivatives of the positions.

    Raises:
        RecordingError: when the velocities are those of another unit of angles.
    """
    long_enough = [segment for segment in segments if len(segment.time) > 2]
    if "velocity" not in statistics.signals or not long_enough:
        return []
    rate, velocity = (torch.cat(x) for x in zip(*map(_rates, long_enough)))
    warnings = []
    for j, name in enumerate(arm.joint_names):
        a, b = rate[:, j], velocity[:, j]
        if a.square().mean().sqrt() < 10 * SIGN_WIDTH:
            continue
        slope = float(a @ b / (a @ a))
        ratio = math.log(max(abs(slope), _TINY))
        if abs(abs(ratio) - math.log(_DEGREES)) < _NEAR:
            raise RecordingError(
                f"{statistics.name}: the velocity of {name} is {slope:.3g} times the derivative of its "
                "position: one of them is in degrees and the other in radians"
            )
        if abs(slope - 1) > _WRONG_SLOPE:
            warnings.append(
                f"the velocity of {name} is {slope:.2f} times the derivative of its position"
                + ("; is its sign wrong?" if slope < -0.5 else "")
            )
    return warnings


def arm_names(arm: Arm, which: Tensor) -> list[str]:
    """Names of the joints that are marked, (J,)."""
    return [name for name, marked in zip(arm.joint_names, which.tolist()) if marked]


def _rates(segment: Segment) -> tuple[Tensor, Tensor]:
    """Central difference of a segment's positions, and its velocity there."""
    step = float(segment.time[1] - segment.time[0])
    return (segment.position[2:] - segment.position[:-2]) / (2 * step), segment.velocity[1:-1]


def _signs(body: RigidBody, segments: list[Segment]) -> tuple[Tensor, Tensor]:
    """Correlation with the description, (J,), and share that friction dissipates, (J,); see ``Agreement``."""
    every = max(1, sum(len(segment.time) for segment in segments) // _SAMPLES)
    q, v, a, torque = (torch.cat([segment[k][::every] for segment in segments]) for k in range(1, 5))
    model = body.torque(q, v, a)
    correlation, dissipated = torch.zeros(body.joints), torch.zeros(body.joints)
    for j in range(body.joints):
        others = _other_columns(v[:, j], a[:, j])
        basis = _orthonormal(others)
        m, t = (x[:, j] - basis @ (basis.T @ x[:, j]) for x in (model, torque))
        size = (m.norm() * t.norm()).clamp_min(_TINY)
        correlation[j] = float(m @ t / size) if m.norm() > 1e-9 * model[:, j].norm().clamp_min(_TINY) else 0.0
        weights = torch.linalg.lstsq(torch.cat([model[:, j : j + 1], others], 1), torque[:, j]).solution
        friction = others[:, :2] @ weights[1:3]
        power = (torque[:, j].square().mean() * v[:, j].square().mean()).sqrt().clamp_min(_TINY)
        dissipated[j] = (friction * v[:, j]).mean() / power
    return correlation, dissipated


def _lag(body: RigidBody, segments: list[Segment]) -> tuple[float, bool]:
    """Time by which torques are later than states [s], and whether that is believed."""
    longest = max(segments, key=lambda segment: len(segment.time))
    step = float(longest.time[1] - longest.time[0])
    reach = min(int(_LONGEST_LAG / step), len(longest.time) // 8)
    q, v, a, torque = (x[:_SAMPLES] for x in longest[1:5])
    if reach < 1:
        return 0.0, False
    model = body.torque(q, v, a)
    inner = slice(reach, len(q) - reach)
    left = torch.zeros(2 * reach + 1, dtype=torch.float64)
    for j in range(body.joints):
        basis = _orthonormal(
            torch.cat([model[inner, j : j + 1], _other_columns(v[inner, j], a[inner, j])], 1)
        )
        shifted = torch.stack(
            [torque[inner.start + k : inner.stop + k, j] for k in range(-reach, reach + 1)], 1
        )
        squares = (shifted - basis @ (basis.T @ shifted)).square().sum(0)
        left += squares / squares[reach].clamp_min(_TINY) / body.joints
    best = int(left.argmin())
    return (best - reach) * step, bool(abs(best - reach) > 1 and left[best] < _BETTER)


def _other_columns(velocity: Tensor, acceleration: Tensor) -> Tensor:
    """What a joint's torque may have beside rigid bodies, (S, 4): friction, offset and rotor inertia."""
    return torch.cat([friction_columns(velocity), acceleration[:, None]], 1)


def _orthonormal(columns: Tensor) -> Tensor:
    """Orthonormal basis (S, k) of what columns (S, k) can explain."""
    return torch.linalg.qr(columns / columns.norm(dim=0).clamp_min(_TINY)).Q
