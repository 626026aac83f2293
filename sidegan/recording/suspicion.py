"""What in a recording contradicts the arm's description: velocities, signs, and signals that are late."""

import math

import torch
from torch import Tensor

from sidegan.errors import RecordingError
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.excited import SMOOTH
from sidegan.recording.raw import Survey
from sidegan.recording.recording import Segment
from sidegan.robot import Arm

_DEGREES = 180 / math.pi
_SAMPLES = 20_000  # enough to tell a sign
_CLEAR = 0.4  # correlation with the model that says something
_LONGEST_LAG = 0.25  # [s]
_BETTER = 0.8  # share of the squared residual that is left when a lag is believed


def velocity_mismatch(known: Survey, arm: Arm, segments: list[Segment]) -> list[str]:
    """What is odd about recorded velocities, beside the derivatives of the positions; raises on other units.

    Raises:
        RecordingError: when the velocities are those of another unit of angles.
    """
    if "velocity" not in known.signals:
        return []
    rates, measured = [], []
    for segment in segments:
        if len(segment.time) > 2:
            step = float(segment.time[1] - segment.time[0])
            rates.append((segment.position[2:] - segment.position[:-2]) / (2 * step))
            measured.append(segment.velocity[1:-1])
    if not rates:
        return []
    rate, velocity = torch.cat(rates), torch.cat(measured)
    found = []
    for j, name in enumerate(arm.joint_names):
        a, b = rate[:, j], velocity[:, j]
        if a.square().mean().sqrt() < 10 * SMOOTH:
            continue
        slope = float(a @ b / (a @ a))
        ratio = max(abs(slope), 1e-12)
        if abs(math.log(ratio / _DEGREES)) < 0.3 or abs(math.log(ratio * _DEGREES)) < 0.3:
            raise RecordingError(
                f"{known.name}: the velocity of {name} is {slope:.3g} times the derivative of its position: "
                "one of them is in degrees and the other in radians"
            )
        if abs(slope - 1) > 0.1:
            found.append(
                f"the velocity of {name} is {slope:.2f} times the derivative of its position"
                + ("; is its sign wrong?" if slope < -0.5 else "")
            )
    return found


def signs(body: RigidBody, segments: list[Segment]) -> tuple[Tensor, Tensor]:
    """How well torque follows the description, (J,), −1 to 1, and the share that friction dissipates, (J,).

    The first is the correlation of the measured torque with that of the arm's description, both without
    what friction and rotor inertia can explain. Near −1 the torque is counted the other way round; near
    0 the motion does not tell. The second is negative where the torque would drive the arm's friction.
    """
    q, v, a, torque = _thinned(segments)
    model = body.torque(q, v, a)
    correlation, friction = torch.zeros(body.joints), torch.zeros(body.joints)
    for j in range(body.joints):
        others = _friction(v[:, j], a[:, j])
        m, t = (_without(others, x[:, j]) for x in (model, torque))
        size = (m.norm() * t.norm()).clamp_min(1e-12)
        correlation[j] = float(m @ t / size) if m.norm() > 1e-9 * model[:, j].norm().clamp_min(1e-12) else 0.0
        weights = torch.linalg.lstsq(torch.cat([model[:, j : j + 1], others], 1), torque[:, j]).solution
        rubbing = others[:, :2] @ weights[1:3]
        power = (torque[:, j].square().mean() * v[:, j].square().mean()).sqrt().clamp_min(1e-12)
        friction[j] = (rubbing * v[:, j]).mean() / power
    return correlation, friction


def lag(body: RigidBody, segments: list[Segment]) -> tuple[float, bool]:
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
        others = torch.cat([model[inner, j : j + 1], _friction(v[inner, j], a[inner, j])], 1)
        basis = torch.linalg.qr(others / others.norm(dim=0).clamp_min(1e-12)).Q
        late = torch.stack([torque[inner.start + k : inner.stop + k, j] for k in range(-reach, reach + 1)], 1)
        squares = (late - basis @ (basis.T @ late)).square().sum(0)
        left += squares / squares[reach].clamp_min(1e-12) / body.joints
    best = int(left.argmin())
    return (best - reach) * step, bool(abs(best - reach) > 1 and left[best] < _BETTER)


def suspicious(arm: Arm, correlation: Tensor, friction: Tensor) -> tuple[list[str], list[str]]:
    """Joints whose torque looks reversed, and joints whose sign the motion does not tell."""
    reversed_, unknown = [], []
    for j, name in enumerate(arm.joint_names):
        against = float(correlation[j]) < -_CLEAR
        if against and float(friction[j]) < _CLEAR:
            reversed_.append(name)
        elif abs(float(correlation[j])) < _CLEAR:
            unknown.append(name)
    return reversed_, unknown


def _thinned(segments: list[Segment]) -> tuple[Tensor, ...]:
    """States and torque of at most so many samples, evenly taken."""
    every = max(1, sum(len(segment.time) for segment in segments) // _SAMPLES)
    return tuple(torch.cat([segment[k][::every] for segment in segments]) for k in range(1, 5))


def _friction(velocity: Tensor, acceleration: Tensor) -> Tensor:
    """What a joint's torque may have beside rigid bodies, (S, 4)."""
    return torch.stack([velocity, torch.tanh(velocity / SMOOTH), torch.ones_like(velocity), acceleration], 1)


def _without(others: Tensor, x: Tensor) -> Tensor:
    """The part of a signal (S,) that the columns (S, k) do not explain."""
    basis = torch.linalg.qr(others / others.norm(dim=0).clamp_min(1e-12)).Q
    return x - basis @ (basis.T @ x)
