"""Delay of a recording's torques behind its motion, estimated from both alone."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array, flatten
from sidegan.base.settings_text import FILL_IN, suggestion
from sidegan.motion.dynamics import RigidBody
from sidegan.recording import thresholds
from sidegan.recording.misfit import subset
from sidegan.recording.recording import Segment
from sidegan.recording.thresholds import LEAST_SCALE

_SAMPLES = 3000  # used, spread over the recording
_ROUNDS = 8  # of Gauss-Newton
_SETTLED = 1e-5  # [s] step at which Gauss-Newton has converged
_STEP = 0.1  # [s] largest delay found by a single fit
_LEAST_KEPT = 0.5  # share of a recording left at the longest delay
_FITS = 8  # each after the delay found so far is removed
_ROUNDING = 1e-12  # relative eigenvalue below which there is no information
_CORRELATED = 5.0  # samples per independent one: the error is low-passed, at ten samples per cut-off period
_AWAY = 0.3  # of a joint's RMS speed, above which friction does not depend on reversals


class Delay(NamedTuple):
    """Delay of torques behind states."""

    seconds: float  # negative if torques are early
    deviation: float = 0.0  # standard deviation of the delay [s]
    given: bool = False  # whether it was set rather than measured
    clear: bool = False  # whether removing it at least halves the squared residual

    @property
    def noticed(self) -> bool:
        """Whether it deserves a warning."""
        return self.lost or (self.believed and abs(self.seconds) > thresholds.NOTABLE_DELAY)

    @property
    def believed(self) -> bool:
        """Whether it differs from zero significantly."""
        return thresholds.CERTAIN_DELAY * self.deviation < abs(self.seconds) and not self.lost

    @property
    def lost(self) -> bool:
        """Whether it is beyond the range of the search."""
        return not self.given and abs(self.seconds) >= thresholds.LONGEST_DELAY

    def statement(self, corrected: bool) -> str:
        """A sentence on the delay, and on whether it was removed."""
        size = abs(self.seconds) * 1e3
        when = "earlier" if self.seconds < 0 else "later"
        if self.given:
            return f"torques are assumed to be {size:g} ms {when} than the motion, as set"
        if self.lost:
            return (
                f"torques look more than {thresholds.LONGEST_DELAY:g} s {when} than the motion, the most "
                "that is searched: left as they are; same motion, same clock? If the delay is real, set "
                f"{suggestion('recording.delay', FILL_IN)} [s]"
            )
        if math.isinf(self.deviation):
            return "the delay of the torques cannot be determined: not corrected"
        done = "corrected" if corrected else "not corrected"
        if not corrected and self.believed and abs(self.seconds) > thresholds.LEAST_DELAY:
            done += f"; {suggestion('recording.delay', None)} corrects it"
        rounded = f"{size:.0f}" if size >= 99.5 else f"{size:.2g}"
        return f"torques are {rounded} ± {self.deviation * 1e3:.2g} ms {when} than the motion: {done}"


def pool_delays(delays: Sequence[Delay]) -> Delay | None:
    """The common delay of several recordings; None if there is only one recording or they differ."""
    if len(delays) < 2 or not all(0 < delay.deviation < math.inf for delay in delays):
        return None
    weights = [delay.deviation**-2 for delay in delays]
    mean = sum(w * delay.seconds for w, delay in zip(weights, delays)) / sum(weights)
    for delay in delays:
        same = max(thresholds.CERTAIN_DELAY * delay.deviation, thresholds.SAME_DELAY)
        if abs(delay.seconds - mean) > same:
            return None
    return Delay(mean, sum(weights) ** -0.5, clear=all(delay.clear for delay in delays))


def estimate_delay(body: RigidBody, segments: list[Segment], less: Callable[[float], list[Segment]]) -> Delay:
    """Delay of the torques, however long; ``less`` returns segments with a delay [s] removed.

    Near a joint's reversals, friction that leads or lags the velocity looks like a delay, so only faster
    samples are used. The exception: if these say that torques are early and all samples say that they are
    late, all samples are used, since torques seldom are early.
    """
    longest = thresholds.LONGEST_DELAY
    coarse = _coarse(body, segments)

    def refined(above: float) -> Delay:
        """Delay from samples in which a joint is faster than the share ``above`` of its RMS speed."""
        taken = coarse
        found = delay_of(body, less(taken) if taken else segments, above)
        for _ in range(_FITS):
            if abs(found.seconds) <= thresholds.NOTABLE_DELAY:
                break
            taken = max(-longest, min(longest, taken + found.seconds))
            found = delay_of(body, less(taken), above)
        whole = taken + found.seconds
        if not coarse and _STEP < abs(whole) < longest:  # so long a delay would have reduced the residual
            return Delay(0.0, math.inf)
        return Delay(max(-longest, min(longest, whole)), found.deviation, clear=coarse != 0)

    away = refined(_AWAY)
    if away.seconds > -thresholds.LEAST_DELAY:
        return away
    whole = refined(0.0)
    return whole if whole.seconds > 0 else away


def _coarse(body: RigidBody, segments: list[Segment]) -> float:
    """Long delay [s], a multiple of the sampling step, with the smallest residual; 0 if there is none."""
    step = float(segments[0].time[1] - segments[0].time[0])
    most = int(max(len(x.time) for x in segments) * (1 - _LEAST_KEPT) / 2)
    furthest = min(round(thresholds.LONGEST_DELAY / step), most)
    inner = [x for x in segments if len(x.time) > 2 * furthest]
    stride = max(1, sum(len(x.time) - 2 * furthest for x in inner) // _SAMPLES)
    states, torques = [], []
    for x in inner:
        rows = np.arange(furthest, len(x.time) - furthest, stride)
        states.append(Segment(*(signal[rows] for signal in x)))
        torques.append(x.torque[rows[:, None] + np.arange(-furthest, furthest + 1)])
    columns = np.concatenate([_columns(body, *x[1:4], x.sign) for x in states])
    torque = np.concatenate(torques)  # (S, D, J)
    weights = 1 / np.maximum(torque[:, furthest].std(0), LEAST_SCALE)
    basis = (columns * weights[:, None]).reshape(-1, columns.shape[2])
    inverse, scale = _inverse(basis)
    right = (torque * weights).swapaxes(1, 2).reshape(len(basis), -1)
    moment = (basis / scale).T @ right
    left = 1 - (moment * (inverse @ moment)).sum(0) / np.square(right).sum(0)
    best = int(left.argmin())
    late = (best - furthest) * step
    clear = left[best] < thresholds.EXPLAINED_BY_DELAY * left[furthest]
    return late if clear and abs(late) > thresholds.NOTABLE_DELAY else 0.0


def delay_of(body: RigidBody, segments: list[Segment], above: float = 0.0) -> Delay:
    """Short delay of the torques with which an arm of these kinematics explains them best.

    A torque that is late by d is Y θ − d (Y θ)˙, fitted with rigid bodies, rotors, friction and offsets, so
    that the description's inertias do not matter. Friction that grows with the load, which else looks like
    a delay, and the time derivative, which has no noise then, follow from the fit before. Joints are weighted
    by their residuals and count only where they are faster than the share ``above`` of their RMS speed.
    """
    step = float(segments[0].time[1] - segments[0].time[0])
    whole = [np.concatenate(x) for x in zip(*(_neighbourhoods(segment) for segment in segments))]
    torque, rate, bend, *states = subset(whole, _SAMPLES)
    before_at_after = [states[k : k + 4] for k in (0, 4, 8)]  # position, velocity, acceleration, sign
    columns = [_columns(body, *x) for x in before_at_after]
    signs = [sign for *_, sign in before_at_after]
    velocity = before_at_after[1][1]
    used = np.abs(velocity) >= above * np.sqrt(np.square(velocity).mean(0))
    rigid = body.parameters_count + body.joints  # links and rotors: their torque is the load
    known = columns[1].shape[2]
    loads, slope = [np.zeros_like(torque)] * 3, rate
    late, deviation = 0.0, math.inf
    for k in range(_ROUNDS):
        # the torque without the delay found so far
        now = torque + late * rate + late**2 / 2 * bend
        loaded = (signs[1] * np.abs(loads[1]))[..., None] * np.eye(body.joints)
        terms = np.concatenate([columns[1], loaded, -slope[..., None]], 2)
        found, deviation = _fit(terms * used[..., None], now * used)
        late = max(-_STEP, min(_STEP, late + float(found[-1])))
        if k and abs(found[-1]) < _SETTLED:
            break
        before, _, after = (
            x @ found[:known] + sign * np.abs(load) * found[known:-1]
            for x, sign, load in zip(columns, signs, loads)
        )
        slope = (after - before) / (2 * step)
        loads = [x[..., :rigid] @ found[:rigid] for x in columns]
    return Delay(late, deviation)


def _columns(body: RigidBody, q: Array, dq: Array, ddq: Array, sign: Array) -> Array:
    """Regressor of rigid bodies, rotors, friction and offsets, (S, J, P), at states (S, J)."""
    others = np.stack([ddq, dq, sign, np.ones_like(dq)], 1)
    terms = flatten(others[:, None] * np.eye(body.joints)[:, None], 2)
    return np.concatenate([body.base_regressor(q, dq, ddq), terms], 2)


def _fit(columns: Array, torque: Array) -> tuple[Array, float]:
    """Parameters of a weighted least-squares fit of columns (S, J, P), and the last one's deviation."""
    weights = 1 / np.maximum(torque.std(0), LEAST_SCALE)
    for _ in range(2):
        rows = (columns * weights[:, None]).reshape(-1, columns.shape[2])
        inverse, scale = _inverse(rows)
        found = inverse @ ((rows / scale).T @ (torque * weights).ravel()) / scale
        weights = 1 / np.maximum(np.sqrt(np.square(torque - columns @ found).mean(0)), 1e-12 / weights)
    return found, float(np.sqrt(_CORRELATED * inverse[-1, -1]) / scale[-1])


def _inverse(rows: Array) -> tuple[Array, Array]:
    """Inverse information (P, P) of rows (N, P) with normalised columns, and the columns' norms, (P,)."""
    scale = np.maximum(np.linalg.norm(rows, axis=0), LEAST_SCALE)
    return np.linalg.pinv((rows / scale).T @ (rows / scale), _ROUNDING, hermitian=True), scale


def _neighbourhoods(segment: Segment) -> list[Array]:
    """A segment's torque, its first and second derivatives, and states before, at and after each sample."""
    step = float(segment.time[1] - segment.time[0])
    rate = np.gradient(segment.torque, step, axis=0)
    bend = np.gradient(rate, step, axis=0)
    states = (*segment[1:4], segment.sign)
    return [x[2:-2] for x in (segment.torque, rate, bend)] + [x[k : k - 4] for k in (1, 2, 3) for x in states]
