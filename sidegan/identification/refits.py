"""Causes that other data or another model throughout would show: the model is fitted anew with them."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import permutations

import numpy as np

from sidegan.base.arrays import TINY, Array, geometric_mean
from sidegan.base.names import listed
from sidegan.base.settings_text import suggestion
from sidegan.identification import thresholds
from sidegan.identification.fit import (
    Extended,
    covariance_of,
    gather,
    least_squares,
    torque_errors,
    weighted_least_squares,
)
from sidegan.identification.measurements import Measurements, subsample
from sidegan.identification.misfit import Misfit, shift_positions
from sidegan.identification.model import TorqueModel
from sidegan.identification.sums import sums_of
from sidegan.identification.verdict import BAD, USABLE, Finding
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.agreement import Agreement
from sidegan.recording.coordinates import couplings
from sidegan.recording.gravity import tilt_of

_SAMPLES = 2_000  # enough to find a zero
_STEP = 1e-4  # [rad or m] of a difference quotient
# [rad or m] unit of a change of zero: its prior deviation, of ``fit.LEAST``, is then 0.1 rad. Links explain
# some changes, as that of the last joint, exactly, and with a much weaker prior: these changes stay zero
_UNIT = 1e-4
_ROUNDS = 12  # of Gauss–Newton
_FARTHEST = 0.3  # [rad or m] change in a round
_SETTLED = 1e-3  # [rad or m] change that ends the rounds
_LEAST_SHARE = 1e-12  # of residuals that remain: less is rounding

_SAMPLES_OF_TILT = 1_000  # enough to find a tilt

_LIKELY = 3  # couplings that are tried in both halves of the samples


def encoder_zeros(misfit: Misfit) -> list[Finding]:
    """Encoder zeros that are off: the data with positions that count from other zeros.

    They are believed if they are significant and explain the residuals in both halves of the samples; those
    that links can make up for cannot be found.
    """
    model, arm, whole = misfit.model, misfit.arm, subsample(misfit.samples, _SAMPLES)
    first, deviation, _ = _fitted_zeros(model, whole, np.ones(model.joints, dtype=bool))
    clear = np.abs(first) > np.maximum(thresholds.NOTABLE_ZERO, thresholds.CERTAIN * deviation)
    if not clear.any():
        return []
    half = len(whole) // 2
    found = [_fitted_zeros(model, x, clear) for x in (whole, whole[:half], whole[half:])]
    zeros = np.where(clear, found[0][0], 0.0)
    for part, _, left in found:
        repeated = np.abs(part - zeros) <= thresholds.REPEATED * np.abs(zeros)
        if not (repeated[clear].all() and left < thresholds.EXPLAINED_BY_STATES):
            return []
    shifts = [
        f"{arm.joint_names[j]} by {zeros[j]:+.2g} {'m' if arm.prismatic[j] else 'rad'}"
        for j in np.flatnonzero(zeros)
    ]
    text = (
        f"the encoder zero looks off: {listed(shifts)}; subtract this from the recorded positions, or "
        f"correct the joint's origin in the description; {misfit.instead(misfit.error(zeros=zeros))}"
    )
    return [Finding(USABLE, text)]


def other_gravity(misfit: Misfit, agreement: Agreement) -> list[Finding]:
    """Another gravity that torques agree with: the model with it, unless it predicts worse.

    Other faults look like another gravity to the description, but not to a model.
    """
    text = agreement.gravity(misfit.arm)
    if text is None:
        return []
    turned = RigidBody(replace(misfit.arm, gravity=agreement.fit.gravity))
    error = misfit.error(TorqueModel(turned, misfit.model.terms))
    return [Finding(BAD, f"{text}; {misfit.instead(error)}")] if error <= misfit.nmse else []


def tilted_base(misfit: Misfit) -> list[Finding]:
    """A gravity that a model finds, which torques do not show to the description."""
    gravity = tilted_gravity(misfit.model, misfit.samples)
    if gravity is None:
        return []
    agreement = misfit.agreement
    return other_gravity(misfit, agreement._replace(fit=agreement.fit._replace(gravity=gravity)))


def rotor_inertias(misfit: Misfit) -> list[Finding]:
    """Rotors: the model with their inertias, which it lacks."""
    terms = misfit.model.terms
    if terms.rotor_inertia:
        return []
    error = misfit.error(TorqueModel(misfit.model.body, replace(terms, rotor_inertia=True)))
    if error >= thresholds.EXPLAINED * misfit.nmse:
        return []
    rotors = f"rotors explain the residuals: with {suggestion('model.rotor_inertia', True)}"
    text = f"{rotors}, {misfit.instead(error)}; are these torques measured at the motors?"
    return [Finding(USABLE, text)]


def _fitted_zeros(model: TorqueModel, samples: Measurements, free: Array) -> tuple[Array, Array, float]:
    """Zeros of the free joints, (J,) marked, fitted together with the model's parameters.

    Also their deviations, (J,), and the share of the residuals' squares that remains, geometric mean.
    """
    joints = model.joints
    zeros = np.zeros(joints)
    plain = gather(model, samples).sums
    parameters = weighted_least_squares(plain).parameters
    before = plain.squares(parameters)
    for _ in range(_ROUNDS):
        shifted = _with_zeros(model, parameters, free)
        data = gather(shifted, shift_positions([samples], zeros))
        fit = weighted_least_squares(data.sums)
        parameters, change = fit.parameters[:-joints], _UNIT * fit.parameters[-joints:]
        zeros = zeros + np.clip(change, -_FARTHEST, _FARTHEST)
        if np.abs(change).max() < _SETTLED:
            break
    covariance = covariance_of(data.sums, fit, torque_errors(shifted, data, fit))
    deviation = _UNIT * np.sqrt(np.maximum(covariance.diagonal()[-joints:], 0))
    shares = data.sums.squares(fit.parameters) / np.maximum(before, TINY)
    return zeros, deviation, geometric_mean(np.maximum(shares, _LEAST_SHARE))


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
    whole = subsample(samples, _SAMPLES_OF_TILT)
    terms = model.regressor(*whole.inputs)[..., model.rigid :]

    def misfit(gravity: Array, part: slice) -> float:
        """Logarithm of the squared residuals in a part of the samples, mean over joints."""
        links = RigidBody(replace(model.arm, gravity=gravity)).regressor(*whole.states)
        sums = sums_of(np.concatenate([links, terms], 2)[part], whole.torque[part])
        return float(np.log(np.maximum(sums.squares(weighted_least_squares(sums).parameters), TINY)).mean())

    return tilt_of(model.arm.gravity, misfit, len(whole))


def coupled_joints(misfit: Misfit) -> list[Finding]:
    """Joints whose motions or torques are coupled: the data with what uncouples them.

    With it, links and terms fitted anew leave far less, in both halves of the samples.
    """
    model, names = misfit.model, misfit.arm.joint_names
    whole, own = subsample(misfit.samples, _SAMPLES_OF_TILT), np.eye(model.joints)
    weights = weighted_least_squares(sums_of(model.regressor(*whole.inputs), whole.torque)).weights

    def left(part: slice, motion: Array, torque: Array, weights: Array | None = None) -> float:
        """Logarithm of the squared residuals in a part of the samples, summed over joints."""
        inputs = whole.inputs if (motion == own).all() else [x @ motion.T for x in whole.states]
        sums = sums_of(model.regressor(*(x[part] for x in inputs)), whole.torque[part] @ torque.T)
        fit = weighted_least_squares(sums) if weights is None else least_squares(sums, weights=weights)
        squares = np.log(np.maximum(sums.squares(fit.parameters), TINY))
        return float(squares.sum() - 2 * np.linalg.slogdet(torque)[1])  # whatever the units of torques

    halves = [slice(None, len(whole) // 2), slice(len(whole) // 2, None)]
    before = [left(half, own, own) for half in halves]
    best, least = None, np.log(thresholds.EXPLAINED_BY_COUPLING)
    candidates = [*_coupled_torques(model, whole), *couplings(names)]
    for likely in sorted(candidates, key=lambda x: left(slice(None, None, 2), x[1], x[2], weights))[:_LIKELY]:
        gain = max(left(half, *likely[1:]) - then for half, then in zip(halves, before))
        if gain < least:
            best, least = likely, gain
    if best is None:
        return []
    text, *matrices = best
    words = misfit.found.training[0].agreement.settings.coupled(names, *matrices)
    return [Finding(USABLE, f"{text}: {words} uncouples them")]


def _coupled_torques(model: TorqueModel, samples: Measurements) -> Iterator[tuple[str, Array, Array]]:
    """Couplings of neighbours' torques alone, with the factor by which one lies in what a joint's lacks."""
    names, own, y = model.arm.joint_names, np.eye(model.joints), model.regressor(*samples.inputs)
    for j, k in permutations(range(model.joints), 2):
        if abs(j - k) != 1:
            continue
        pair = samples.torque[:, [j, k]]
        rest = pair - y[:, j] @ np.linalg.lstsq(y[:, j], pair)[0]
        factor = float(rest[:, 0] @ rest[:, 1]) / max(float(rest[:, 1] @ rest[:, 1]), TINY)
        factor = round(factor) if abs(abs(factor) - 1) < thresholds.WHOLE_RATIO else factor
        text = f"the torque of {names[j]} looks like its own and {factor:.2g} times that of {names[k]}"
        yield f"{text}, as where a belt couples their motors", own, own - factor * np.outer(own[j], own[k])
