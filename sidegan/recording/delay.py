"""Delay of a recording's torques behind its motion, estimated from both alone."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array, flatten
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.recording import Segment

_SAMPLES = 3000  # used, spread over the recording
_ROUNDS = 4  # of Gauss-Newton
_SETTLED = 1e-5  # [s] step at which Gauss-Newton has converged
_STEP = 0.1  # [s] largest delay found by a single fit
_NEAR = 0.02  # [s] up to which a single fit is accurate, and a delay needs no warning
LONGEST = 1.0  # [s] longest delay that is searched
_LEAST_KEPT = 0.5  # share of a recording left at the longest delay
_FITS = 8  # each after the delay found so far is removed
_BETTER = 0.5  # largest residual at a long delay, relative to that without
_ROUNDING = 1e-12  # relative eigenvalue below which there is no information
_CORRELATED = 5.0  # samples per independent one: the error is low-passed, at ten samples per cut-off period
_CLEAR = 3.0  # standard deviations from zero at which a delay is believed
_WORTH = 2e-3  # [s] smallest delay worth removing; stiction looks like smaller ones
_ALIKE = 3e-3  # [s] between delays of the same arm, part of which may be stiction
_AWAY = 0.3  # of a joint's RMS speed, above which friction does not depend on reversals


class Delay(NamedTuple):
    """Delay of torques behind states."""

    seconds: float  # negative if torques are early
    deviation: float = 0.0  # standard deviation of the delay [s]
    given: bool = False  # whether it was set rather than measured
    clear: bool = False  # whether removing it at least halves the residual

    @property
    def noticed(self) -> bool:
        """Whether it deserves a warning."""
        return self.lost or (self.believed and abs(self.seconds) > _NEAR)

    @property
    def believed(self) -> bool:
        """Whether it differs from zero significantly."""
        return _CLEAR * self.deviation < abs(self.seconds) and not self.lost

    @property
    def lost(self) -> bool:
        """Whether it is beyond the range of the search."""
        return not self.given and abs(self.seconds) >= LONGEST

    def statement(self, corrected: bool) -> str:
        """A sentence on the delay, and on whether it was removed."""
        size = abs(self.seconds) * 1e3
        when = "earlier" if self.seconds < 0 else "later"
        if self.given:
            return f"torques are assumed to be {size:g} ms {when} than the motion, as set"
        if self.lost:
            return (
                f"torques look more than {LONGEST:g} s {when} than the motion, the most that is searched: "
                "left as they are; same motion, same clock? If the delay is real, set recording.delay=… [s]"
            )
        worth = self.believed and abs(self.seconds) > _WORTH
        left = "not corrected" + "; recording.delay=null corrects it" * worth
        if math.isinf(self.deviation):
            return "the delay of the torques cannot be determined: not corrected"
        rounded = f"{size:.0f}" if size >= 99.5 else f"{size:.2g}"
        delay = f"torques are {rounded} ± {self.deviation * 1e3:.2g} ms {when} than the motion"
        return f"{delay}: {'corrected' if corrected else left}"


def pooled(delays: Sequence[Delay]) -> Delay | None:
    """The common delay of several recordings; None if there is only one recording or they differ."""
    if len(delays) < 2 or not all(0 < delay.deviation < math.inf for delay in delays):
        return None
    weights = [delay.deviation**-2 for delay in delays]
    mean = sum(w * delay.seconds for w, delay in zip(weights, delays)) / sum(weights)
    apart = any(abs(delay.seconds - mean) > max(_CLEAR * delay.deviation, _ALIKE) for delay in delays)
    return None if apart else Delay(mean, sum(weights) ** -0.5, clear=all(delay.clear for delay in delays))


def measured(body: RigidBody, segments: list[Segment], less: Callable[[float], list[Segment]]) -> Delay:
    """Delay of the torques, however long; ``less`` returns segments with a delay [s] removed.

    Near a joint's reversals, friction that leads or lags the velocity looks like a delay, so only faster
    samples are used. The exception: if these say that torques are early and all samples say that they are
    late, all samples are used. Friction lags, and removing that lag explains more of it.
    """
    away = _refined(body, segments, less, _AWAY)
    if away.seconds > -_WORTH:
        return away
    whole = _refined(body, segments, less, 0.0)
    return whole if whole.seconds > 0 else away


def _refined(
    body: RigidBody, segments: list[Segment], less: Callable[[float], list[Segment]], above: float
) -> Delay:
    """Delay from samples in which a joint is faster than the share ``above`` of its RMS speed."""
    taken = coarse = _coarse(body, segments)
    found = delay_of(body, less(taken) if taken else segments, above)
    for _ in range(_FITS):
        if abs(found.seconds) <= _NEAR:
            break
        taken = max(-LONGEST, min(LONGEST, taken + found.seconds))
        found = delay_of(body, less(taken), above)
    whole = taken + found.seconds
    if not coarse and _STEP < abs(whole) < LONGEST:  # so long a delay would have reduced the residual
        return Delay(0.0, math.inf)
    return Delay(max(-LONGEST, min(LONGEST, whole)), found.deviation, clear=coarse != 0)


def _coarse(body: RigidBody, segments: list[Segment]) -> float:
    """Long delay [s], a multiple of the sampling step, with the smallest residual; 0 if there is none."""
    step = float(segments[0].time[1] - segments[0].time[0])
    furthest = min(round(LONGEST / step), int(max(len(x.time) for x in segments) * (1 - _LEAST_KEPT) / 2))
    inner = [x for x in segments if len(x.time) > 2 * furthest]
    stride = max(1, sum(len(x.time) - 2 * furthest for x in inner) // _SAMPLES)
    states, torques = [], []
    for x in inner:
        rows = np.arange(furthest, len(x.time) - furthest, stride)
        states.append(Segment(*(signal[rows] for signal in x)))
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
    """Short delay of the torques with which an arm of these kinematics explains them best.

    A torque that is late by d is Y θ − d τ̇, fitted with rigid bodies, friction, offsets and rotors, so that
    the description's inertias do not matter. Joints are weighted by their residuals and count only where
    they are faster than the share ``above`` of their RMS speed.
    """
    whole = [np.concatenate(x) for x in zip(*map(_rates, segments))]
    stride = max(1, len(whole[0]) // _SAMPLES)
    q, dq, ddq, torque, sign, rate, bend = (x[::stride] for x in whole)
    known = _columns(body, q, dq, ddq, sign)
    if above:
        fast = np.abs(dq) >= above * np.sqrt(np.square(dq).mean(0))
        known, torque, rate, bend = known * fast[..., None], torque * fast, rate * fast, bend * fast
    late = 0.0
    deviation = math.inf
    for _ in range(_ROUNDS):
        # the torque without the delay found so far
        now = torque + late * rate + late**2 / 2 * bend
        step, deviation = _step(np.concatenate([known, -(rate + late * bend)[..., None]], 2), now)
        late = max(-_STEP, min(_STEP, late + step))
        if abs(step) < _SETTLED:
            break
    return Delay(late, deviation)


def _columns(body: RigidBody, q: Array, dq: Array, ddq: Array, sign: Array) -> Array:
    """Regressor of rigid bodies, friction, offsets and rotors, (S, J, P), at states (S, J)."""
    others = np.stack([dq, sign, np.ones_like(dq), ddq], -1)
    terms = flatten(others[:, :, None] * np.eye(body.joints)[..., None], 2)
    return np.concatenate([body.base_regressor(q, dq, ddq), terms], 2)


def _step(columns: Array, torque: Array) -> tuple[float, float]:
    """Last parameter of a weighted least-squares fit of columns (S, J, P), and its standard deviation."""
    weights = 1 / np.maximum(torque.std(0), 1e-300)
    for _ in range(2):
        rows = (columns * weights[:, None]).reshape(-1, columns.shape[2])
        inverse, scale = _inverse(rows)
        found = inverse @ ((rows / scale).T @ (torque * weights).ravel()) / scale
        weights = 1 / np.maximum(np.sqrt(np.square(torque - columns @ found).mean(0)), 1e-12 / weights)
    return float(found[-1]), float(np.sqrt(_CORRELATED * inverse[-1, -1]) / scale[-1])


def _inverse(rows: Array) -> tuple[Array, Array]:
    """Inverse information (P, P) of rows (N, P) with normalised columns, and the columns' norms, (P,)."""
    scale = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    return np.linalg.pinv((rows / scale).T @ (rows / scale), _ROUNDING, hermitian=True), scale


def _rates(segment: Segment) -> list[Array]:
    """A segment's states, torque and sign, and the torque's first and second time derivatives."""
    step = float(segment.time[1] - segment.time[0])
    rate = np.gradient(segment.torque, step, axis=0)
    bend = np.gradient(rate, step, axis=0)
    return [x[2:-2] for x in (*segment[1:], rate, bend)]
