"""By how much a recording's torques are later than its motion, from the motion and the torques alone."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array, flatten
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.recording import Segment

_SAMPLES = 3000  # that are looked at, spread over the recording
_ROUNDS = 4  # of Gauss-Newton
_SETTLED = 1e-5  # [s]
_STEP = 0.1  # [s] that a single fit goes at most
_NEAR = 0.02  # [s] up to which a single fit is right, and a delay is no reason to warn
LONGEST = 1.0  # [s] that is looked for
_LEAST_KEPT = 0.5  # of a recording that the longest one leaves
_FITS = 8  # with what was found taken off
_BETTER = 0.5  # of what is left without a delay, that a long one leaves at most
_ROUNDING = 1e-12  # relative eigenvalue that is no information
# samples of a low-passed error, kept ten to a period of the cut-off, that tell as much as one
_CORRELATED = 5.0
_CLEAR = 3.0  # deviations off zero at which a delay is believed
_WORTH = 2e-3  # [s]: a delay that is worth taking off; friction that sticks passes for a smaller one
_ALIKE = 3e-3  # [s] between delays of one arm: friction that sticks passes for some of it
_AWAY = 0.3  # of a joint's usual speed, above which its friction is that of one direction


class Delay(NamedTuple):
    """Time by which torques are later than states."""

    seconds: float  # negative where they are earlier
    deviation: float = 0.0  # standard deviation of that [s]
    given: bool = False  # whether it was set, not measured
    clear: bool = False  # whether less than half of what is left without it is left with it

    @property
    def noticed(self) -> bool:
        """Whether a person should look at it."""
        return self.lost or (self.believed and abs(self.seconds) > _NEAR)

    @property
    def believed(self) -> bool:
        """Whether there is one beyond doubt; one as long as the search goes is where that was stopped."""
        return _CLEAR * self.deviation < abs(self.seconds) and not self.lost

    @property
    def lost(self) -> bool:
        """Whether the search was stopped before it found one."""
        return not self.given and abs(self.seconds) >= LONGEST

    def statement(self, taken_off: bool) -> str:
        """A sentence on the delay, and on whether it is taken off."""
        size, when = abs(self.seconds) * 1e3, "earlier" if self.seconds < 0 else "later"
        if self.given:
            return f"torques are assumed to be {size:g} ms {when} than the motion, as set"
        if self.lost:
            return (
                f"torques look more than {LONGEST:g} s {when} than the motion, the most that is searched: "
                "left as they are; same motion, same clock? If the delay is real, set recording.delay=… [s]"
            )
        worth = self.believed and abs(self.seconds) > _WORTH
        left = "not corrected" + "; recording.delay=null takes it off" * worth
        if math.isinf(self.deviation):
            return "the delay of the torques cannot be determined: not corrected"
        rounded = f"{size:.0f}" if size >= 99.5 else f"{size:.2g}"
        said = f"torques are {rounded} ± {self.deviation * 1e3:.2g} ms {when} than the motion"
        return f"{said}: {'taken off' if taken_off else left}"


def pooled(delays: Sequence[Delay]) -> Delay | None:
    """The delay that recordings have in common; None of a single one, or where they have not the same."""
    if len(delays) < 2 or not all(0 < one.deviation < math.inf for one in delays):
        return None
    weights = [one.deviation**-2 for one in delays]
    mean = sum(w * one.seconds for w, one in zip(weights, delays)) / sum(weights)
    apart = any(abs(one.seconds - mean) > max(_CLEAR * one.deviation, _ALIKE) for one in delays)
    return None if apart else Delay(mean, sum(weights) ** -0.5, clear=all(one.clear for one in delays))


def measured(body: RigidBody, segments: list[Segment], less: Callable[[float], list[Segment]]) -> Delay:
    """Delay of the torques, however long; ``less`` gives segments that have a delay [s] taken off.

    Near the reversals of a joint, friction that leads or lags its velocity passes for a delay, so that it is
    measured away from them. Only where torques would be earlier than the motion then and later with these,
    it is that of all samples: friction lags, and taking that off explains more of it.
    """
    away = _refined(body, segments, less, _AWAY)
    if away.seconds > -_WORTH:
        return away
    whole = _refined(body, segments, less, 0.0)
    return whole if whole.seconds > 0 else away


def _refined(
    body: RigidBody, segments: list[Segment], less: Callable[[float], list[Segment]], above: float
) -> Delay:
    """Delay from samples in which a joint is faster than a share of its usual speed."""
    taken = coarse = _coarse(body, segments)
    found = delay_of(body, less(taken) if taken else segments, above)
    for _ in range(_FITS):
        if abs(found.seconds) <= _NEAR:
            break
        taken = max(-LONGEST, min(LONGEST, taken + found.seconds))
        found = delay_of(body, less(taken), above)
    whole = taken + found.seconds
    if not coarse and _STEP < abs(whole) < LONGEST:  # where hardly less is left than without it
        return Delay(0.0, math.inf)
    return Delay(max(-LONGEST, min(LONGEST, whole)), found.deviation, clear=coarse != 0)


def _coarse(body: RigidBody, segments: list[Segment]) -> float:
    """The long delay [s], a multiple of the time between samples, that leaves least; 0 where none is long."""
    step = float(segments[0].time[1] - segments[0].time[0])
    furthest = min(round(LONGEST / step), int(max(len(x.time) for x in segments) * (1 - _LEAST_KEPT) / 2))
    inner = [x for x in segments if len(x.time) > 2 * furthest]
    every = max(1, sum(len(x.time) - 2 * furthest for x in inner) // _SAMPLES)
    states, torques = [], []
    for x in inner:
        rows = np.arange(furthest, len(x.time) - furthest, every)
        states.append(Segment(*(one[rows] for one in x)))
        torques.append(x.torque[rows[:, None] + np.arange(-furthest, furthest + 1)])
    columns = np.concatenate([_columns(body, *x[1:4], x.sign) for x in states])
    torque = np.concatenate(torques)  # (S, D, J)
    weights = 1 / np.maximum(torque[:, furthest].std(0), 1e-300)
    basis = (columns * weights[:, None]).reshape(-1, columns.shape[2])
    inverse, scale = _inverse(basis)
    right = (torque * weights).swapaxes(1, 2).reshape(len(basis), -1)
    moment = (basis / scale).T @ right
    left = 1 - (moment * (inverse @ moment)).sum(0) / np.square(right).sum(0)
    best = int(left.argmin())
    late = (best - furthest) * step
    return late if abs(late) > _NEAR and left[best] < _BETTER * left[furthest] else 0.0


def delay_of(body: RigidBody, segments: list[Segment], above: float = 0.0) -> Delay:
    """Delay of the torques, a short one, with which an arm of these kinematics explains them best.

    A torque that is late by d is Y θ − d τ̇. That is fitted with rigid bodies, friction, offsets and rotors,
    so that the description's inertias do not matter; each joint counts by its residual, where it is faster
    than a share of its usual speed.
    """
    whole = [np.concatenate(x) for x in zip(*map(_rates, segments))]
    every = max(1, len(whole[0]) // _SAMPLES)
    q, dq, ddq, torque, sign, rate, bend = (x[::every] for x in whole)
    known = _columns(body, q, dq, ddq, sign)
    if above:
        fast = np.abs(dq) >= above * np.sqrt(np.square(dq).mean(0))
        known, torque, rate, bend = known * fast[..., None], torque * fast, rate * fast, bend * fast
    late, deviation = 0.0, math.inf
    for _ in range(_ROUNDS):
        # where the torque would be if it came earlier by what was found so far
        now = torque + late * rate + late**2 / 2 * bend
        step, deviation = _step(np.concatenate([known, -(rate + late * bend)[..., None]], 2), now)
        late = max(-_STEP, min(_STEP, late + step))
        if abs(step) < _SETTLED:
            break
    return Delay(late, deviation)


def _columns(body: RigidBody, q: Array, dq: Array, ddq: Array, sign: Array) -> Array:
    """Columns of rigid bodies, friction, offsets and rotors, (S, J, P), at states (S, J)."""
    others = np.stack([dq, sign, np.ones_like(dq), ddq], -1)
    terms = flatten(others[:, :, None] * np.eye(body.joints)[..., None], 2)
    return np.concatenate([body.base_regressor(q, dq, ddq), terms], 2)


def _step(columns: Array, torque: Array) -> tuple[float, float]:
    """The last parameter of weighted least squares on columns (S, J, P), and its deviation."""
    weights = 1 / np.maximum(torque.std(0), 1e-300)
    for _ in range(2):
        rows = (columns * weights[:, None]).reshape(-1, columns.shape[2])
        inverse, scale = _inverse(rows)
        found = inverse @ ((rows / scale).T @ (torque * weights).ravel()) / scale
        weights = 1 / np.maximum(np.sqrt(np.square(torque - columns @ found).mean(0)), 1e-12 / weights)
    return float(found[-1]), float(np.sqrt(_CORRELATED * inverse[-1, -1]) / scale[-1])


def _inverse(rows: Array) -> tuple[Array, Array]:
    """Inverse information (P, P) of rows (N, P) over the lengths of their columns, and these, (P,)."""
    scale = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    return np.linalg.pinv((rows / scale).T @ (rows / scale), _ROUNDING, hermitian=True), scale


def _rates(segment: Segment) -> list[Array]:
    """A segment's states, torque and sign, with the torque's first and second derivative."""
    step = float(segment.time[1] - segment.time[0])
    rate = np.gradient(segment.torque, step, axis=0)
    bend = np.gradient(rate, step, axis=0)
    return [x[2:-2] for x in (*segment[1:], rate, bend)]
