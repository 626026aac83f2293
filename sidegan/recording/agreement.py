"""Comparison of recorded torques with the arm's description: gravity, scale and sign."""

import math
from collections.abc import Sequence
from itertools import permutations
from typing import NamedTuple

import numpy as np
import scipy  # submodules load lazily

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.base.settings_text import setting_name, suggest_fields, suggestion
from sidegan.motion.dynamics import RigidBody
from sidegan.recording import thresholds
from sidegan.recording.coordinates import Map, positions_behind
from sidegan.recording.gravity import GravityFit, fit_gravity
from sidegan.recording.misfit import (
    friction_basis,
    halves_of,
    misfit,
    misfit_by_order,
    other_columns,
    share_left,
    subset,
    told_by,
    unexplained,
)
from sidegan.recording.recording import Segment
from sidegan.recording.settings import RecordingSettings
from sidegan.recording.thresholds import NEGLIGIBLE
from sidegan.robot import Arm
from sidegan.robot.placement import describe_direction, in_base, mount_of, straightened

_SAMPLES = 20_000  # enough to determine a sign
_FEW = 2_000  # enough to detect swapped motions
_ORDERED = 7  # most joints whose orders are all tried
_SKETCH = 200  # samples to compare many orders by
_PACES = -3.0, 3.0  # logarithms of the paces that are tried
_RATED = {"per cent": 100.0, "per mille": 1000.0, "shares": 1.0}  # units of a joint's largest torque


class Agreement(NamedTuple):
    """Agreement of the measured torque with the arm's description."""

    fit: GravityFit  # gravity and scales that explain the torques best
    order: Array  # joint whose described torque fits each measured one, (J,): itself, unless swapped
    positions: Map | None  # what recorded positions are, if others explain the torques far better
    columns: list[int] | None  # joint's column, in the arm's order, if all signals have another joint order
    moved: Array  # range of each joint [rad or m], (J,)
    # share of the power that friction dissipates, (J,); negative where friction would have to drive the arm
    friction: Array
    usual: Array  # 99th percentile of the absolute measured torque [N·m or N], (J,)
    needed: Array  # 99th percentile of the absolute described torque [N·m or N], (J,)
    settings: RecordingSettings  # with which the recording was read
    pace: float = 1.0  # times that the motion was faster than recorded, by its torques; 1 if they do not tell

    @property
    def sign(self) -> Array:
        """Correlation with the described torque, without friction and rotors, −1 to 1, (J,).

        Near −1 the torque has the opposite sign; near 0 the motion does not determine the sign.
        """
        return self.fit.correlation

    @property
    def heavier(self) -> float:
        """Median ratio of measured to described torque over joints with a clear sign; 1 if there are none."""
        clear = np.abs(self.fit.scale[np.abs(self.sign) > thresholds.CORRELATED])
        return float(np.median(clear)) if len(clear) else 1.0

    @property
    def rescaled(self) -> Array:
        """Joints whose torques are clearly in another unit, or those of other masses, (J,)."""
        scale = self.fit.scale
        odd = (scale > thresholds.OTHER_UNIT) | (scale < 1 / thresholds.OTHER_UNIT)
        return (self.sign > thresholds.CLEARLY_CORRELATED) & odd

    def rated(self, arm: Arm) -> str | None:
        """Question whether torques are in units of each joint's largest; None if scales are not all such."""
        known = (self.sign > thresholds.CORRELATED) & np.isfinite(arm.torque_limit)
        limits = arm.torque_limit[known]
        if known.sum() < thresholds.FEW_JOINTS or limits.max() < thresholds.OTHER_UNIT * limits.min():
            return None
        for name, whole in _RATED.items():
            if (np.abs(np.log(self.fit.scale[known] * limits / whole)) < thresholds.SCALE_OF_LIMITS).all():
                gains = suggestion("robot.gains", (arm.torque_limit / whole).tolist(), ".4g")
                return (
                    f"the torques look like {name} of each joint's limit; to read them as such: {gains} "
                    f"with {to_currents()}"
                )
        return None

    def doubts(self, arm: Arm) -> list[str]:
        """Warnings about contradictions between description and torques, other than gravity."""
        found = []
        scale, rescaled = self.fit.scale, self.rescaled
        if self.pace != 1:
            found.append(
                f"with a motion {self.pace:.2g} times as fast the torques fit the description far better: "
                "are the time stamps right? (recording.units.time, or recording.rate where there are none)"
            )
        elif rated := self.rated(arm):
            found.append(rated)
        elif rescaled.any():
            joints = zip(arm.joint_names, scale.tolist(), rescaled.tolist())
            shares = listed([f"{scale:.2g} ({name})" for name, scale, marked in joints if marked], arm.joints)
            found.append(
                f"measured torques are {shares} times those expected from the description: wrong unit, wrong "
                f"gain or wrong masses? (recording.units, {setting_name('robot.gains')})"
            )
        reversed_ = self.sign < -thresholds.CLEARLY_CORRELATED  # these are the arm's torques, too
        fitting = (self.sign > thresholds.CORRELATED) | reversed_
        told = int((self.sign != 0).sum())  # joints whose links do more than rotors, unlike a gantry's
        if told and thresholds.STRANGE_ARM * fitting.sum() <= told:
            found.append(
                "hardly any torque matches the description: is this the right arm, and its joint order?"
            )
        return found

    def gravity(self, arm: Arm) -> str | None:
        """Warning about the gravity in these torques; None if it matches the description's."""
        if np.array_equal(self.fit.gravity, arm.gravity):
            return None
        if not self.fit.gravity.any():
            return (
                "these torques contain no gravity, although the description's links have mass: a driver that "
                "compensates gravity may leave it out; record the total torque, or add that of gravity"
            )
        found = straightened(in_base(arm, self.fit.gravity))
        described = straightened(in_base(arm, arm.gravity))
        mount = [round(x, 3) + 0.0 for x in mount_of(None, found.tolist())]
        return (
            f"in these torques gravity acts along {describe_direction(found)} of the base, by the "
            f"description along {describe_direction(described)}: is the arm mounted like that? "
            f"({suggestion('robot.mount', mount, '.4g')})"
        )

    @property
    def convention(self) -> bool:
        """Whether all torques have the opposite sign: those of all joints, several, that show theirs."""
        moved = self.moved >= thresholds.MOVED_FOR_SIGN
        shown = moved & (np.abs(self.sign) > thresholds.CORRELATED)
        forward = moved & ((self.sign > thresholds.CORRELATED) | (self.friction > thresholds.CORRELATED))
        return shown.sum() >= min(thresholds.FEW_JOINTS, len(shown)) and not forward.any()

    def runs_against(self, driven: bool = False) -> Array:
        """Joints with a reversed torque, (J,); ``driven``: only if it does not overcome friction."""
        against = (self.sign < -thresholds.CORRELATED) & (self.moved >= thresholds.MOVED_FOR_SIGN)
        found = against & (self.friction < (thresholds.DISSIPATED if driven else thresholds.CORRELATED))
        return np.ones_like(found) if self.convention and found.any() else found

    def reversed(self, arm: Arm, driven: bool = False) -> str | None:
        """Warning about joints with a reversed torque; None if there are none. See ``runs_against``."""
        against = self.runs_against(driven)
        if not against.any():
            return None
        names, remedy = arm.named(against), to_reverse(arm, against, self.settings.reverse)
        question = ": is its sign wrong?"
        if self.convention:
            question = ", as far as the motion shows: does the driver count torques the other way?"
        return f"the torque of {names} runs against the description{question} {remedy}"

    def exchanged(self, arm: Arm) -> str | None:
        """Warning about joints whose torques or motions look swapped or reversed; None if there are none."""
        if self.columns:
            order = {"joints": [k + 1 for k in self.columns], "position": "q{joint}", "torque": "tau{joint}"}
            return (
                "the columns look like those of another joint order, in which they explain the torques far "
                f"better: {suggest_fields('recording', order)} for columns like q1 and tau1, and so on for "
                "other signals"
            )
        moved = [j for j, k in enumerate(self.order.tolist()) if j != k]
        if self.positions:
            return self.positions.text
        if not moved:
            return None
        fits = [f"that of {arm.joint_names[j]} fits {arm.joint_names[self.order[j]]}" for j in moved]
        return f"torques look swapped: {', '.join(fits)}; is the order of columns right? (recording.torque)"

    def warnings(self, arm: Arm) -> list[str]:
        """All warnings, including joints whose sign the motion does not determine."""
        silent = (np.abs(self.sign) < thresholds.CORRELATED) | (self.moved < thresholds.MOVED_FOR_SIGN)
        swapped = self.exchanged(arm)
        found = [swapped] if swapped else [self.gravity(arm), *self.doubts(arm), self.reversed(arm)]
        warnings = [warning for warning in found if warning]
        if silent.any() and not self.convention:
            warnings.append(
                f"the motion does not show whether the sign of the torque of {arm.named(silent)} is right"
            )
        return warnings


def to_reverse(arm: Arm, odd: Array, reverse: Sequence[str]) -> str:
    """The setting that reverses the torques of marked joints, (J,), beside what is set, in parentheses."""
    marked = zip(arm.joint_names, odd.tolist())
    return f"({suggestion('recording.reverse', [name for name, x in marked if x != (name in reverse)])})"


def to_currents() -> str:
    """Settings that read torques as currents."""
    efforts = suggestion("recording.effort", "current")
    columns = suggest_fields("recording", {"torque": None, "current": "tau{index}"})
    return f"{efforts} for columns of efforts, {columns} for columns like tau1"


def agreement_of(body: RigidBody, segments: list[Segment], settings: RecordingSettings) -> Agreement:
    """Agreement of segments, read with these settings, with an arm's description."""
    stride = max(1, sum(len(segment.time) for segment in segments) // _SAMPLES)
    q, v, a, torque = [np.concatenate([x[::stride] for x in signal]) for signal in [*zip(*segments)][1:5]]
    fit = fit_gravity(body, q, v, a, torque)
    model = body.torque(q, v, a)
    positions = positions_behind(body, fit.misfit, settings, q, v, a, torque)
    found = Agreement(
        fit=fit,
        order=_order(model, v, a, torque),
        positions=positions,
        settings=settings,
        columns=_columns(body, positions, q, v, a, torque) if fit.misfit > thresholds.LEFT_BY_MAP else None,
        moved=np.ptp(q, 0),
        friction=_dissipated(model, v, a, torque),
        usual=np.quantile(np.abs(torque), thresholds.USUAL_TORQUE, 0),
        needed=np.quantile(np.abs(model), thresholds.USUAL_TORQUE, 0),
    )
    return found._replace(pace=_pace(body, q, v, a, torque)) if found.rescaled.any() else found


def _pace(body: RigidBody, *states: Array) -> float:
    """Times that the motion in states, (S, J), was faster than recorded; 1 unless torques show it clearly.

    A motion faster by k has k times the velocity and k² times the acceleration, with the same gravity.
    """
    q, v, a, torque = subset(states, _FEW)

    def at(pace: float) -> float:
        return misfit(body, q, pace * v, pace**2 * a, torque)

    best = scipy.optimize.minimize_scalar(lambda x: at(math.exp(x)), bounds=_PACES, options={"xatol": 1e-2})
    pace = math.exp(best.x)
    better = best.fun < at(1.0) + 2 * math.log(thresholds.EXPLAINED_BY_MAP)
    return pace if better and abs(best.x) > math.log(thresholds.OTHER_PACE) else 1.0


def _order(model: Array, v: Array, a: Array, torque: Array) -> Array:
    """Joint whose described torque fits each measured one best, (J,); arguments are (S, J).

    Both are without the friction and rotor of the measuring joint.
    """
    own = np.arange(model.shape[1])
    basis = friction_basis(v, a)
    share = share_left(told_by(basis, model), unexplained(basis, torque))
    found = scipy.optimize.linear_sum_assignment(np.log(share).T)[1]
    other = found != own
    clear = share[found, own] < thresholds.EXPLAINED_BY_MAP * share.diagonal()
    return found if clear[other].all() else own


def _columns(body: RigidBody, positions: Map | None, *signals: Array) -> list[int] | None:
    """Column of each joint, (J,), in positions, velocities, accelerations and torques, (S, J).

    None unless another order than the arm's fits far better, in both halves of the samples, than the arm's
    and than other positions.
    """
    if body.joints > _ORDERED:
        return None
    orders = [list(order) for order in permutations(range(body.joints))]
    best = min(orders, key=misfit_by_order(body, *subset(signals, _SKETCH)))
    gain = sum(j != k for j, k in enumerate(best)) * math.log(thresholds.EXPLAINED_BY_MAP)
    for x in halves_of(subset(signals, _FEW)):
        other = misfit(body, *(positions.of(*x) if positions else x))
        ordered = misfit_by_order(body, *x)(best)
        if not (gain and ordered < min(other + gain, body.joints * math.log(thresholds.LEFT_BY_MAP))):
            return None
    return best


def _dissipated(model: Array, v: Array, a: Array, torque: Array) -> Array:
    """Share of the power that friction dissipates, (J,), see ``Agreement``; arguments are (S, J)."""
    columns = np.concatenate([other_columns(v, a), model[..., None]], 2).swapaxes(0, 1)  # (J, S, 5)
    weights = np.stack([np.linalg.lstsq(*system)[0] for system in zip(columns, torque.T)])
    friction = (columns[..., :2] @ weights[:, :2, None])[..., 0].T
    power = np.maximum(np.sqrt(np.square(torque).mean(0) * np.square(v).mean(0)), NEGLIGIBLE)
    return (friction * v).mean(0) / power
