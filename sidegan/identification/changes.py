"""Causes that come and go: another load or friction, a contact, or a drift, in a part of the recordings."""

from collections.abc import Sequence
from functools import reduce
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import TINY, Array, geometric_mean
from sidegan.base.names import listed
from sidegan.identification import thresholds
from sidegan.identification.fit import (
    Extended,
    Fit,
    Gathered,
    covariance_of,
    gather,
    residual_of,
    torque_errors,
    weighted_least_squares,
)
from sidegan.identification.identified import measurements_of
from sidegan.identification.measurements import Measurements, pieces, subsample
from sidegan.identification.misfit import Misfit
from sidegan.identification.model import Terms, TorqueModel
from sidegan.identification.payload import with_load
from sidegan.identification.sums import Sums
from sidegan.identification.verdict import USABLE, Finding
from sidegan.recording.checked import CheckedRecording
from sidegan.recording.clock import stamp_text

_STRETCHES, _FINER = 12, 4  # equal parts of a recording between which a load is sought, and parts of each
_LEAST_SAMPLES = 5  # in the smallest part
_WINDOWS, _LEAST_IN_WINDOW = 12, 10  # equal parts of a recording that are compared, and samples of each
_LEAST_SIZE = 1e-12  # of what residuals, velocities and variances are divided by


def other_load_or_friction(misfit: Misfit) -> list[Finding]:
    """A recording whose load or friction differs: the model with further columns in it alone.

    The one that explains most. The data cannot say which of two recordings it is: the second is named.
    """
    model, recordings = misfit.model, misfit.found.recordings
    if len(recordings) < 2:
        return []
    candidates = [(with_load(model, carried=True), _other_load)]
    if {"viscous", "coulomb"} <= {*model.kinds}:
        candidates.append((_with_friction(model), _other_friction))
    changes = []
    for extended, words in candidates:
        partly = _Partly(extended, model.count, [measurements_of([x]) for x in recordings])
        for k in range(1 if len(recordings) < 3 else 0, len(recordings)):
            fitted = partly.fitted(k, k + 1)
            if fitted.explains and (text := words(misfit, partly, fitted, k)):
                changes.append((fitted.remaining, text))
    return [Finding(USABLE, text) for _, text in sorted(changes)[:1]]


def held_loads(misfit: Misfit) -> list[Finding]:
    """A load held in a stretch of a recording: the model with a load in it alone."""
    texts = [_held_load(misfit, recording) for recording in misfit.found.recordings]
    return [Finding(USABLE, text) for text in texts if text]


class _Fitted(NamedTuple):
    """A model that was fitted with further columns in a part of the data."""

    sums: Sums
    fit: Fit
    after: Array  # squared residuals of each joint, summed over samples, (J,)
    remaining: float  # the same over those without the columns, mean over joints

    @property
    def explains(self) -> bool:
        """Whether the columns explain the residuals, and the model the torques."""
        left = geometric_mean(self.after / np.maximum(self.sums.energy, TINY))
        return self.remaining < thresholds.EXPLAINED and left < thresholds.FITTING


class _Partly:
    """A model whose further columns count in some parts of the data alone."""

    def __init__(self, extended: Extended, count: int, parts: Sequence[list[Measurements]]) -> None:
        self.extended, self.count = extended, count
        self.data = [gather(extended, part) for part in parts]
        self.without = [data.sums.first(count) for data in self.data]
        plain = reduce(Sums.plus, self.without)
        self.before = np.maximum(plain.squares(weighted_least_squares(plain).parameters), TINY)

    def fitted(self, begin: int, end: int) -> _Fitted:
        """The fit with the columns from one part until before another."""
        within = [data.sums for data in self.data[begin:end]]
        sums = reduce(Sums.plus, [*self.without[:begin], *within, *self.without[end:]])
        fit = weighted_least_squares(sums)
        after = np.maximum(sums.squares(fit.parameters), TINY)
        return _Fitted(sums, fit, after, geometric_mean(after / self.before))

    def load(self, fitted: _Fitted, samples: list[Measurements]) -> tuple[float, float]:
        """Mass of the load [kg] and its deviation, of samples that it is in."""
        errors = torque_errors(self.extended, Gathered(fitted.sums, samples), fitted.fit)
        variance = covariance_of(fitted.sums, fitted.fit, errors)[self.count, self.count]
        return fitted.fit.parameters[self.count], np.sqrt(variance)


def _other_load(misfit: Misfit, partly: _Partly, fitted: _Fitted, k: int) -> str:
    """Words on another load in recording k; empty if its mass is not significant."""
    mass, deviation = partly.load(fitted, partly.data[k].pieces)
    if abs(mass) <= misfit.least_mass(deviation):
        return ""
    return (
        f"{misfit.found.recordings[k].name} was recorded with a different load than the others: {mass:+.2g} "
        f"± {deviation:.1g} kg on {misfit.arm.link_names[-1]} explains it; identify from recordings with one "
        "load (+experiment=payload identifies the difference)"
    )


def _other_friction(misfit: Misfit, partly: _Partly, fitted: _Fitted, k: int) -> str:
    """Words on other friction in recording k."""
    joints = misfit.arm.named(fitted.after < thresholds.EXPLAINED * partly.before)
    return (
        f"in {misfit.found.recordings[k].name} the friction of {joints} differs: is the arm warmer or colder "
        "there, or much slower or faster? record after warming up, and identify from recordings of one "
        "temperature and pace"
    )


def _with_friction(model: TorqueModel) -> Extended:
    """The model with further viscous and Coulomb friction of each joint."""
    friction = Terms(offset=False, sign_width=model.terms.sign_width)

    def columns(_: Array, dq: Array, ddq: Array, sign: Array | None) -> Array:
        signals = friction.signals(dq, ddq, sign)
        return np.concatenate([x[..., None] * np.eye(model.joints) for x in signals], 2)

    return Extended(model, 2 * model.joints, columns)


def _held_load(misfit: Misfit, recording: CheckedRecording) -> str:
    """Words on a load held in a stretch of a recording, if that explains most of its residuals; or empty."""
    whole = measurements_of([recording])
    time = np.concatenate([segment.time for segment in recording.segments])
    cuts = np.linspace(0, len(time), _STRETCHES * _FINER + 1).astype(int).tolist()
    if len(time) < _LEAST_SAMPLES * len(cuts):
        return ""
    samples, last = subsample(whole, len(time)), len(cuts) - 1
    parts = [[samples[begin:end]] for begin, end in pairwise(cuts)]
    partly = _Partly(with_load(misfit.model, carried=True), misfit.model.count, parts)

    def remaining(stretch: tuple[int, int]) -> float:
        return partly.fitted(*stretch).remaining

    coarse = [*combinations(range(0, len(cuts), _FINER), 2)]
    coarse.remove((0, last))
    begin, end = min(coarse, key=remaining)
    near = range(1 - _FINER, _FINER)
    begin, _ = min(((begin + d, end) for d in near if 0 <= begin + d < end), key=remaining)
    _, end = min(((begin, end + d) for d in near if begin < end + d <= last), key=remaining)
    fitted = partly.fitted(begin, end)
    mass, deviation = partly.load(fitted, whole)
    if not fitted.explains or abs(mass) < misfit.least_mass(deviation) or end - begin < _FINER:
        return ""
    if mass < 0 and (begin == 0 or end == last):  # the rest of the recording is without it
        begin, end, mass = (end, last, -mass) if begin == 0 else (0, begin, -mass)
    return (
        f"{_rows(recording.name, time[cuts[begin]], time[cuts[end] - 1])} torques fit with "
        f"{mass:+.2g} ± {deviation:.1g} kg on {misfit.arm.link_names[-1]}: was something held? cut these "
        "rows, or put them in another file: +experiment=payload 'recordings=[rest.csv]' "
        "'loaded=[held.csv]' identifies the load"
    )


def _rows(name: str, begin: float, end: float) -> str:
    """Words on a part of a recording, by its time stamps [s] to the hundredth."""
    return f"from {stamp_text(round(begin, 2))} to {stamp_text(round(end, 2))} of {name}"


def contacts_and_drifts(misfit: Misfit) -> list[Finding]:
    """Contacts, and torque sensors that drift: the model's residuals over time."""
    model, arm, texts = misfit.model, misfit.arm, []
    for recording in misfit.found.recordings:
        time, position, velocity, _, torque, _ = (np.concatenate(x) for x in zip(*recording.segments))
        if len(time) < _WINDOWS * _LEAST_IN_WINDOW:
            continue
        parts = pieces(measurements_of([recording]))
        left = np.concatenate([residual_of(model, x, misfit.found.chosen.parameters) for x in parts])
        begin, end, sizes, far = _contact(time, velocity, torque, left)
        if far.any():
            texts.append(
                f"{_rows(recording.name, begin, end)} the residual of {arm.named(far)} is "
                f"{sizes[far].max():.2g} times that of the rest: did the arm touch something? cut these rows"
            )
        changes = _drift(time, position, left)
        if changes.any():
            drifts = [f"{arm.joint_names[j]} by {changes[j]:.2g}" for j in np.flatnonzero(changes)]
            texts.append(
                f"through {recording.name} the torque drifts, of {listed(drifts)} N·m or N: does a sensor "
                "warm up? record when it is warm, or tare it between shorter recordings"
            )
    return [Finding(USABLE, text) for text in texts]


def _contact(
    time: Array, velocity: Array, torque: Array, residual: Array
) -> tuple[float, float, Array, Array]:
    """Times of the part whose residuals, (S, J), are largest, how large, and which are far too large, (J,).

    Relative to those of the median part, and to the velocity: a model's own errors grow with the motion.
    Where torques have hardly any noise, as simulated ones, their size counts, too.
    """
    sizes, speeds = (_relative(x) for x in (residual, velocity))
    excess = sizes / np.maximum(speeds, 1.0)
    worst = int(excess.max(1).argmax())
    begin, end = np.array_split(time, _WINDOWS)[worst][[0, -1]]
    felt = np.square(np.array_split(residual, _WINDOWS)[worst]).mean(0) > thresholds.FELT * torque.var(0)
    return begin, end, sizes[worst], felt & (excess[worst] > thresholds.CONTACT)


def _drift(time: Array, position: Array, residual: Array) -> Array:
    """Changes of residuals, (S, J), along a straight line in time, (J,); 0 if they do not, or motion does."""
    away = time - time.mean()
    motion = position - position.mean(0)
    if np.square(motion @ np.linalg.lstsq(motion, away)[0]).sum() > thresholds.LIKE_DRIFT * (away @ away):
        return np.zeros(residual.shape[1])
    slope = away @ residual / (away @ away)
    variance = np.maximum(len(time) * residual.var(0), _LEAST_SIZE)
    drifting = np.square(slope) * (away @ away) / variance > thresholds.DRIFT
    return np.where(drifting, slope * (time[-1] - time[0]), 0.0)


def _relative(x: Array) -> Array:
    """Root mean square of (S, J) in each part of a recording, over that of the median part, (W, J)."""
    sizes = np.stack([np.sqrt(np.square(part).mean(0)) for part in np.array_split(x, _WINDOWS)])
    return sizes / np.maximum(np.median(sizes, 0), _LEAST_SIZE)
