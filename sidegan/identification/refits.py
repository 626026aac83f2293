"""Refits with encoder zeros, another gravity, or a change of the arm, as explanations of a misfit."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import reduce
from itertools import combinations, pairwise, permutations

import numpy as np
import scipy  # its parts are imported when they are used

from sidegan.base.arrays import Array, geometric_mean
from sidegan.identification.fit import (
    Extended,
    Fit,
    Gathered,
    covariance_of,
    gather,
    least_squares,
    reweighted,
    torque_errors,
)
from sidegan.identification.identified import IdentifiedArm, measurements_of
from sidegan.identification.measurements import Measurements, subsample
from sidegan.identification.model import Terms, TorqueModel
from sidegan.identification.payload import with_load
from sidegan.identification.sums import Sums, sums_of
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.check import CheckedRecording
from sidegan.recording.coordinates import couplings

_SURE = 5.0  # standard deviations from zero at which a zero or a load is significant
_EXPLAINED = 0.7  # largest share of the residuals' squares that may remain with other zeros or gravity
_TINY = np.finfo(float).tiny

_SAMPLES = 2_000  # enough to find a zero
_STEP = 1e-4  # [rad or m] of a difference quotient
# [rad or m] unit of a change of zero: its prior deviation, of ``fit.LEAST``, is then 0.1 rad. Links explain
# some changes, as that of the last joint, exactly, and with a much weaker prior: these changes stay zero
_UNIT = 1e-4
_ROUNDS = 12  # of Gauss–Newton
_FARTHEST = 0.3  # [rad or m] change in a round
_SETTLED = 1e-3  # [rad or m] change that ends the rounds
_NOTABLE_ZERO = 0.05  # [rad or m] smallest difference reported
_ALIKE = 0.5  # largest difference between parts of the samples, relative to the zero's

_SAMPLES_OF_TILT = 1_000  # enough to find a tilt
_FIRST = 0.05  # [rad] of the search
_FINE = 1e-3  # [rad] at which it ends
_NOTABLE_TILT = 0.03  # [rad] smallest tilt that is reported

_COUPLED = 0.3  # most of the squares that may remain without a coupling
_LIKELY = 3  # couplings that are tried in both halves of the samples
_WHOLE = 0.05  # largest difference from 1 of a factor that is taken for 1

_HALF = 0.5  # most of the residuals' squares that may remain if a change is to explain them
_FITS = 0.1  # most of the torques' squares that may remain then
_NOTABLE_LOAD = 0.02  # smallest load that is reported, as a share of the arm's mass
_STRETCHES, _FINER = 12, 4  # equal parts of a recording between which a load is sought, and parts of each
_LEAST_SAMPLES = 5  # in the smallest part


def shifted_zeros(model: TorqueModel, samples: Sequence[Measurements]) -> Array:
    """Positions [rad or m] that a recording has where the description has zero, (J,); 0 where they agree.

    Links and terms of the model are fitted anew with them. They are believed if they are significant and
    explain the residuals in both halves of the samples; those that links can make up for cannot be found.
    """
    whole = subsample(samples, _SAMPLES)
    first, deviation, _ = _fitted_zeros(model, whole, np.ones(model.joints, dtype=bool))
    clear = np.abs(first) > np.maximum(_NOTABLE_ZERO, _SURE * deviation)
    if not clear.any():
        return np.zeros(model.joints)
    half = len(whole) // 2
    found = [_fitted_zeros(model, x, clear) for x in (whole, whole[:half], whole[half:])]
    zeros = np.where(clear, found[0][0], 0.0)
    alike = all((np.abs(part - zeros) <= _ALIKE * np.abs(zeros))[clear].all() for part, *_ in found[1:])
    return zeros if alike and all(left < _EXPLAINED for *_, left in found) else np.zeros(model.joints)


def moved(samples: Sequence[Measurements], zeros: Array | float) -> list[Measurements]:
    """Samples whose positions count from other zeros [rad or m], (J,)."""
    return [replace(x, position=x.position - zeros) for x in samples]


def _fitted_zeros(model: TorqueModel, samples: Measurements, free: Array) -> tuple[Array, Array, float]:
    """Zeros of the free joints, (J,) marked, fitted together with the model's parameters.

    Also their deviations, (J,), and the share of the residuals' squares that remains, geometric mean.
    """
    joints = model.joints
    zeros = np.zeros(joints)
    plain = gather(model, samples).sums
    parameters = reweighted(plain).parameters
    before = plain.squares(parameters)
    for _ in range(_ROUNDS):
        shifted = _with_zeros(model, parameters, free)
        data = gather(shifted, moved([samples], zeros))
        fit = reweighted(data.sums)
        parameters, change = fit.parameters[:-joints], _UNIT * fit.parameters[-joints:]
        zeros = zeros + np.clip(change, -_FARTHEST, _FARTHEST)
        if np.abs(change).max() < _SETTLED:
            break
    covariance = covariance_of(data.sums, fit, torque_errors(shifted, data, fit))
    deviation = _UNIT * np.sqrt(np.maximum(covariance.diagonal()[-joints:], 0))
    shares = data.sums.squares(fit.parameters) / np.maximum(before, _TINY)
    return zeros, deviation, geometric_mean(np.maximum(shares, 1e-12))


def _with_zeros(model: TorqueModel, parameters: Array, free: Array) -> Extended:
    """The model with columns for small changes of the free joints' zeros, in units of ``_UNIT``."""

    def columns(q: Array, dq: Array, ddq: Array, sign: Array | None) -> Array:
        added = np.zeros((len(q), model.joints, model.joints))
        for j in np.flatnonzero(free):
            step = _STEP * np.eye(model.joints)[j]
            less, more = (model.torque(parameters, x, dq, ddq, sign) for x in (q - step, q + step))
            added[:, :, j] = _UNIT * (less - more) / (2 * _STEP)
        return added

    return Extended(model, model.joints, columns)


def tilted_gravity(model: TorqueModel, samples: Sequence[Measurements]) -> Array | None:
    """Gravity [m/s²] in the base frame, (3,), that explains torques far better; None if none does.

    Links and friction are fitted anew with it. Its magnitude is the description's, which masses make up for.
    """
    described = model.arm.gravity
    size = float(np.linalg.norm(described))
    if not size > 0:
        return None
    across = np.linalg.svd(described[None])[2][1:]  # two directions at right angles to it, (2, 3)
    whole = subsample(samples, _SAMPLES_OF_TILT)
    terms = model.regressor(*whole.inputs)[..., model.rigid :]

    def turned(tilt: Array) -> Array:
        direction = described / size + tilt @ across
        return size * direction / np.linalg.norm(direction)

    def left(gravity: Array, *parts: slice) -> list[float]:
        """Logarithm of the squared residuals in each part of the samples, mean over joints."""
        links = RigidBody(replace(model.arm, gravity=gravity)).regressor(*whole.states)
        y = np.concatenate([links, terms], 2)
        each = [sums_of(y[part], whole.torque[part]) for part in parts]
        squares = [sums.squares(reweighted(sums).parameters) for sums in each]
        return [float(np.log(np.maximum(x, _TINY)).mean()) for x in squares]

    found = scipy.optimize.minimize(
        lambda tilt: left(turned(tilt), slice(None))[0],
        np.zeros(2),
        method="Nelder-Mead",
        options={
            "initial_simplex": _FIRST * np.array([[0, 0], [1, 0], [0, 1]]),
            "xatol": _FINE,
            "fatol": 0.1,
        },
    ).x
    half = len(whole) // 2
    now, before = (left(g, slice(None, half), slice(half, None)) for g in (turned(found), described))
    better = all(x < y + np.log(_EXPLAINED) for x, y in zip(now, before))
    return turned(found) if np.linalg.norm(found) > _NOTABLE_TILT and better else None


def coupled(model: TorqueModel, samples: Sequence[Measurements]) -> tuple[str, Array, Array] | None:
    """What the recorded motion or torques look like, and matrices (J, J) that uncouple them; None if nothing.

    With them, links and terms fitted anew leave far less, in both halves of the samples.
    """
    whole = subsample(samples, _SAMPLES_OF_TILT)
    own = np.eye(model.joints)
    weights = reweighted(sums_of(model.regressor(*whole.inputs), whole.torque)).weights

    def left(part: slice, motion: Array, torque: Array, weights: Array | None = None) -> float:
        """Logarithm of the squared residuals in a part of the samples, summed over joints."""
        inputs = whole.inputs if (motion == own).all() else [x @ motion.T for x in whole.states]
        sums = sums_of(model.regressor(*(x[part] for x in inputs)), whole.torque[part] @ torque.T)
        fit = reweighted(sums) if weights is None else least_squares(sums, weights=weights)
        squares = np.log(np.maximum(sums.squares(fit.parameters), _TINY))
        return float(squares.sum() - 2 * np.linalg.slogdet(torque)[1])  # whatever the units of torques

    halves = [slice(None, len(whole) // 2), slice(len(whole) // 2, None)]
    before = [left(half, own, own) for half in halves]
    candidates = [*_coupled_torques(model, whole), *couplings(model.arm.joint_names)]
    likely = sorted(candidates, key=lambda x: left(slice(None, None, 2), x[1], x[2], weights))[:_LIKELY]
    gains = [max(left(half, *x[1:]) - then for half, then in zip(halves, before)) for x in likely]
    best = min(zip(gains, likely), key=lambda x: x[0], default=(0.0, None))
    return best[1] if best[0] < np.log(_COUPLED) else None


def _coupled_torques(model: TorqueModel, samples: Measurements) -> Iterator[tuple[str, Array, Array]]:
    """Couplings of neighbours' torques alone, with the factor by which one lies in what a joint's lacks."""
    names, own, y = model.arm.joint_names, np.eye(model.joints), model.regressor(*samples.inputs)
    for j, k in permutations(range(model.joints), 2):
        if abs(j - k) != 1:
            continue
        pair = samples.torque[:, [j, k]]
        rest = pair - y[:, j] @ np.linalg.lstsq(y[:, j], pair)[0]
        factor = float(rest[:, 0] @ rest[:, 1]) / max(float(rest[:, 1] @ rest[:, 1]), _TINY)
        factor = round(factor) if abs(abs(factor) - 1) < _WHOLE else factor
        text = f"the torque of {names[j]} looks like its own and {factor:.2g} times that of {names[k]}"
        yield f"{text}, as where a belt couples their motors", own, own - factor * np.outer(own[j], own[k])


def change_between(found: IdentifiedArm) -> list[str]:
    """A remark on a recording whose load or friction differs, if that explains most of the residuals."""
    model = found.model
    plain = gather(model, measurements_of(found.recordings)).sums
    before = np.maximum(plain.squares(reweighted(plain).parameters), _TINY)
    changes = [*_changes(found, with_load(model, carried=True), before, load=True)]
    if {"viscous", "coulomb"} <= {*model.kinds}:
        friction = Terms(offset=False, sign_width=model.terms.sign_width)

        def columns(_: Array, dq: Array, ddq: Array, sign: Array | None) -> Array:
            signals = friction.signals(dq, ddq, sign)
            return np.concatenate([x[..., None] * np.eye(model.joints) for x in signals], 2)

        changes += _changes(found, Extended(model, 2 * model.joints, columns), before, load=False)
    return [remark for _, remark in sorted(changes)[:1]]


def _changes(
    found: IdentifiedArm, extended: Extended, before: Array, load: bool
) -> Iterator[tuple[float, str]]:
    """Share of the residuals' squares, (J,) ``before``, that remains with further columns in one recording.

    Also a remark on it. Only changes that explain the residuals, and loads that are significant.
    """
    arm, count, recordings = found.model.arm, found.model.count, found.recordings
    data = [gather(extended, measurements_of([recording])) for recording in recordings]
    same = [_only(x.sums, count) for x in data]
    # the data cannot say which of two recordings it is: the second is named, and of one none
    for k in range(1 if len(data) < 3 else 0, len(data)):
        sums = reduce(Sums.plus, [*same[:k], data[k].sums, *same[k + 1 :]])
        fit = reweighted(sums)
        after = np.maximum(sums.squares(fit.parameters), _TINY)
        remaining = geometric_mean(after / before)
        left = geometric_mean(after / np.maximum(sums.energy, _TINY))
        if remaining >= _HALF or left >= _FITS:
            continue
        name = recordings[k].name
        if load:
            errors = torque_errors(extended, data[k]._replace(sums=sums), fit)
            mass, deviation = fit.parameters[count], np.sqrt(covariance_of(sums, fit, errors)[count, count])
            least = _NOTABLE_LOAD * arm.inertial_parameters[:, 0].sum()
            if abs(mass) <= max(_SURE * deviation, least):
                continue
            text = (
                f"{name} was recorded with a different load than the others: {mass:+.2g} ± "
                f"{deviation:.1g} kg on {arm.link_names[-1]} explains it; identify from recordings with one "
                "load (+experiment=payload identifies the difference)"
            )
        else:
            text = (
                f"in {name} the friction of {arm.named(after < _HALF * before)} differs: is the arm warmer "
                "or colder there, or much slower or faster? record after warming up, and identify from "
                "recordings of one temperature and pace"
            )
        yield remaining, text


def held_load(found: IdentifiedArm, recording: CheckedRecording) -> list[str]:
    """A remark on a load held in a stretch of a recording, if that explains most of its residuals."""
    arm, count = found.model.arm, found.model.count
    extended, whole = with_load(found.model, carried=True), measurements_of([recording])
    time = np.concatenate([segment.time for segment in recording.segments])
    cuts = np.linspace(0, len(time), _STRETCHES * _FINER + 1).astype(int).tolist()
    if len(time) < _LEAST_SAMPLES * len(cuts):
        return []
    samples = subsample(whole, len(time))
    loaded = [gather(extended, samples[begin:end]).sums for begin, end in pairwise(cuts)]
    free = [_only(x, count) for x in loaded]
    plain = reduce(Sums.plus, free)
    before = np.maximum(plain.squares(reweighted(plain).parameters), _TINY)

    def fitted(begin: int, end: int) -> tuple[float, Sums, Fit]:
        """Share of the residuals' squares that remains with the load between two cuts, sums and fit."""
        sums = reduce(Sums.plus, [*free[:begin], *loaded[begin:end], *free[end:]])
        fit = reweighted(sums)
        return geometric_mean(np.maximum(sums.squares(fit.parameters), _TINY) / before), sums, fit

    stretches = [*combinations(range(0, len(cuts), _FINER), 2)]
    stretches.remove((0, len(loaded)))
    begin, end = min(stretches, key=lambda x: fitted(*x)[0])
    near = range(1 - _FINER, _FINER)
    begin = min((x for d in near if 0 <= (x := begin + d) < end), key=lambda x: fitted(x, end)[0])
    end = min((x for d in near if begin < (x := end + d) < len(cuts)), key=lambda x: fitted(begin, x)[0])
    remaining, sums, fit = fitted(begin, end)
    left = geometric_mean(sums.squares(fit.parameters) / np.maximum(sums.energy, _TINY))
    errors = torque_errors(extended, Gathered(sums, whole), fit)
    mass, deviation = fit.parameters[count], np.sqrt(covariance_of(sums, fit, errors)[count, count])
    least = max(_SURE * deviation, _NOTABLE_LOAD * arm.inertial_parameters[:, 0].sum())
    if remaining >= _HALF or left >= _FITS or abs(mass) < least or end - begin < _FINER:
        return []
    if mass < 0 and (begin == 0 or end == len(loaded)):  # the rest of the recording is without it
        begin, end, mass = (end, len(loaded), -mass) if begin == 0 else (0, begin, -mass)
    first, last = time[cuts[begin]], time[cuts[end] - 1]
    return [
        f"from {first:.3g} s to {last:.3g} s of {recording.name} torques fit with {mass:+.2g} ± "
        f"{deviation:.1g} kg on {arm.link_names[-1]}: was something held? cut these rows, or put them "
        "in another file: +experiment=payload 'recordings=[rest.csv]' 'loaded=[held.csv]' identifies the load"
    ]


def _only(sums: Sums, count: int) -> Sums:
    """Sums in which all but the first columns are zero."""
    kept = np.arange(sums.moment.shape[1]) < count
    return sums._replace(information=sums.information * (kept[:, None] & kept), moment=sums.moment * kept)
