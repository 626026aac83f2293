"""A recording beside the arm's description: signs of torques, late signals, excited base parameters."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import torch
from torch import Tensor

from sidegan.motion.dynamics import RigidBody
from sidegan.recording.recording import SIGN_WIDTH, Segment
from sidegan.robot import Arm

WEAK = 0.05  # share of its own below which a parameter takes twenty times the deviation it would have alone
_SAMPLES_AT_ONCE = 4096
_ROUNDING = 1e-13  # relative eigenvalue that is no information
_SAMPLES = 20_000  # enough to tell a sign
_CLEAR = 0.4  # correlation with the model that says something
_STRANGE = 4  # times as many joints as agree: the description is hardly that of the arm
_MOST = 0.99  # of the samples have less than the usual torque
_LONGEST_LAG = 0.25  # [s]
_BETTER = 0.8  # share of the squared residual that is left when a lag is believed
_TINY = 1e-12


class Agreement(NamedTuple):
    """Agreement of the measured torque with the arm's description."""

    # correlation of both without what friction and rotor inertia can explain, −1 to 1, (J,). Near −1
    # the torque is counted the other way round; near 0 the motion does not tell
    sign: Tensor
    # share of the power that friction dissipates, (J,); negative where the torque would drive the arm's
    # friction
    friction: Tensor
    lag: float  # time by which torques are later than states [s]
    late: bool  # whether the lag is believed
    usual: Tensor  # largest torque but for a hundredth of the samples [N·m or N], (J,)
    needed: Tensor  # the same of what the description's links need [N·m or N], (J,)
    # median of measured over needed torque, without what friction and rotor inertia can explain, of the
    # joints whose sign is told; 1 where none is
    heavier: float

    def warnings(self, arm: Arm) -> list[str]:
        """Joints whose torque looks reversed, or whose sign the motion does not tell, and the lag."""
        against, silent = self.sign < -_CLEAR, self.sign.abs() < _CLEAR
        reversed_ = arm.named(against & (self.friction < _CLEAR))
        warnings = []
        if reversed_:
            warnings.append(
                f"the torque of {reversed_} runs against the description: is its sign wrong? "
                f"(recording.reverse=[{reversed_.replace(', ', ',')}])"
            )
        if silent.any():
            warnings.append(
                f"the motion does not tell whether the sign of the torque of {arm.named(silent)} is right"
            )
        if _STRANGE * int((self.sign > _CLEAR).sum()) <= arm.joints:
            warnings.append(
                "hardly any torque is as described: is this the arm, and are its joints in this order?"
            )
        if self.late:
            when = "later" if self.lag > 0 else "earlier"
            warnings.append(f"torques look {abs(self.lag) * 1e3:.0f} ms {when} than the states")
        return warnings


def agreement_of(body: RigidBody, segments: list[Segment]) -> Agreement:
    """Agreement of segments with an arm's description."""
    every = max(1, sum(len(segment.time) for segment in segments) // _SAMPLES)
    q, v, a, torque = (torch.cat([segment[k][::every] for segment in segments]) for k in range(1, 5))
    model = body.torque(q, v, a)
    sign, friction, slope = _signs(model, v, a, torque)
    clear = slope[sign.abs() > _CLEAR].abs()
    heavier = float(clear.median()) if len(clear) else 1.0
    usual, needed = (x.abs().quantile(_MOST, 0) for x in (torque, model))
    return Agreement(sign, friction, *_lag(body, segments), usual, needed, heavier)


def _signs(model: Tensor, v: Tensor, a: Tensor, torque: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Correlation with the description, share that friction dissipates, and slope, (J,); see ``Agreement``.

    The description's torque, velocity, acceleration and measured torque are (S, J) each.
    """
    joints = model.shape[1]
    correlation, dissipated, slope = (torch.zeros(joints, dtype=torch.float64) for _ in range(3))
    for j in range(joints):
        others = _other_columns(v[:, j], a[:, j])
        basis = _orthonormal(others)
        m, t = (x[:, j] - basis @ (basis.T @ x[:, j]) for x in (model, torque))
        size = (m.norm() * t.norm()).clamp_min(_TINY)
        correlation[j] = float(m @ t / size) if m.norm() > 1e-9 * model[:, j].norm().clamp_min(_TINY) else 0.0
        slope[j] = float(m @ t / m.square().sum().clamp_min(_TINY**2))
        weights = torch.linalg.lstsq(torch.cat([model[:, j : j + 1], others], 1), torque[:, j]).solution
        friction = others[:, :2] @ weights[1:3]
        power = (torque[:, j].square().mean() * v[:, j].square().mean()).sqrt().clamp_min(_TINY)
        dissipated[j] = (friction * v[:, j]).mean() / power
    return correlation, dissipated, slope


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


@dataclass(frozen=True, eq=False)
class Excitation:
    """What a recording can tell about the base parameters, (p,) each."""

    names: tuple[str, ...]  # of the base parameters
    # root mean square of the torque that the arm's own value of it makes, over all joints [N·m or N]
    contribution: Tensor
    alone: Tensor  # share of a parameter's regressor column that no other column can stand in for, 0 to 1
    deviation: Tensor  # expected standard deviation of its estimate, for independent errors of ``noise``
    condition_number: float  # of the regressor with columns scaled to one length

    @property
    def weak(self) -> list[str]:
        """Parameters whose column the others nearly stand in for, or that nothing moves."""
        return [name for name, share in zip(self.names, self.alone.tolist()) if share < WEAK]

    def warnings(self) -> list[str]:
        """Base parameters that are hardly excited."""
        if not self.weak:
            return []
        return [
            f"{len(self.weak)} of {len(self.names)} base parameters are hardly excited (condition number "
            f"{self.condition_number:.3g}): {', '.join(self.weak)}"
        ]

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row per base parameter."""
        keys = ("contribution", "alone", "deviation")
        columns = (getattr(self, key).tolist() for key in keys)
        return [{"name": name, **dict(zip(keys, row))} for name, *row in zip(self.names, *columns)]


def excitation_of(body: RigidBody, segments: Iterable[Segment], noise: Tensor) -> Excitation:
    """Excitation of the base parameters beside friction, with joints weighted by their torque's noise.

    That is the standard deviation of each joint's torque errors [N·m or N], (J,). The arm's own parameters
    give the contributions only.
    """
    values = body.base.values
    count = len(values) + 3 * body.joints
    gram = torch.zeros(count, count, dtype=torch.float64)
    squares, samples = torch.zeros(len(values), dtype=torch.float64), 0
    each = torch.eye(body.joints, dtype=torch.float64)
    for segment in segments:
        for part in zip(*(x.split(_SAMPLES_AT_ONCE) for x in segment[1:4])):
            y = body.base_regressor(*part)
            squares += y.square().sum((0, 1))
            friction = torch.einsum("sjk,ji->sjik", friction_columns(part[1]), each).flatten(2)
            rows = (torch.cat([y, friction], 2) / noise[:, None]).flatten(0, 1)
            gram += rows.T @ rows
            samples += len(y)
    scale = gram.diagonal().sqrt()
    scale = torch.where(scale > 0, scale, torch.ones_like(scale))
    eigenvalues, vectors = torch.linalg.eigh(gram / scale[:, None] / scale)
    floor = _ROUNDING * eigenvalues[-1].clamp_min(1e-300)
    inflation = (vectors.square() / eigenvalues.clamp_min(floor)).sum(1)[: len(values)]
    return Excitation(
        names=body.base.names,
        contribution=(squares / max(samples, 1)).sqrt() * values.abs(),
        alone=inflation.rsqrt().clamp_max(1),
        deviation=inflation.sqrt() / scale[: len(values)],
        condition_number=float((eigenvalues[-1] / eigenvalues[0].clamp_min(floor)).sqrt()),
    )


def friction_columns(velocity: Tensor) -> Tensor:
    """Viscous friction, Coulomb friction and offset of a joint, (…, 3), at velocities (…)."""
    return torch.stack([velocity, torch.tanh(velocity / SIGN_WIDTH), torch.ones_like(velocity)], -1)
