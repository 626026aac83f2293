"""Causes of a model's misfit: faults found when checking the recordings, and faults that would explain it."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.identification.changed import change_in
from sidegan.identification.disturbances import disturbances
from sidegan.identification.estimate import estimate
from sidegan.identification.identified import IdentifiedArm, measurements_of
from sidegan.identification.model import TorqueModel
from sidegan.identification.score import score, shown
from sidegan.identification.sums import scaled_inverse
from sidegan.identification.tilt import tilted_gravity
from sidegan.identification.verdict import (
    BAD,
    GOOD,
    USABLE,
    Finding,
    implausible_links,
    implausible_mass,
    joint_of,
)
from sidegan.identification.zeros import moved, shifted_zeros
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.agreement import Agreement, agreement_of, to_reverse

_ROUNDING = 1e-10
_EXPLAINED = 0.5  # share of the error that may remain if a fault in the recordings is to explain it
_SURE = 5.0  # standard deviations from zero at which a mass or an offset is significant
_CLEAR = 3.0  # standard deviations from one at which a torque scale is, if the description agrees
_ALIKE = 0.98  # correlation with the description's torque that counts as agreement
_SCALE = 0.03  # smallest scale error of a joint's torque that is reported
_NOTABLE = 0.02  # smallest load that is reported, as a share of the arm's mass
_OFFSET, _OFFSET_LIMIT = 0.2, 0.02  # smallest offset reported: share of the usual torque, and of its limit


def causes_of(found: IdentifiedArm) -> tuple[list[Finding], bool]:
    """Findings against the recordings, the description or the links; whether gravity points elsewhere.

    A fault that would cause the others is reported alone.
    """
    model = found.model
    arm = found.model.arm
    links = found.links
    unused: dict[str, str] = {}
    for recording in found.recordings[::-1]:  # reversed: the first recording's remark on a signal wins
        unused |= recording.remarks
    level = USABLE if found.quality.verdict == BAD else GOOD  # a bad model: the repair may be wrong
    repairs = [Finding(level, text) for text in unused.values()]
    segments = [segment for recording in found.training for segment in recording.segments]
    agreement = agreement_of(model.body, segments)
    exchanged, gravity = agreement.exchanged(arm), agreement.gravity(arm)
    now = error = found.quality.judged.nmse_mean
    if gravity and (error := _error_with(found, agreement.load.gravity)) > now:
        gravity = None  # other faults look like it to the description, but not to a model
    against = None if gravity else agreement.reversed(arm, driven=True)
    unexplained = found.quality.verdict != GOOD and not (exchanged or gravity or against)
    faults = [f"{x.name}: {text}" for x in found.recordings for text in x.faults]
    if unexplained:
        because = change_in(found) or _odd_validation(found, agreement)
        if not (because or faults):  # which look like disturbances
            because = disturbances(found)
        if because:
            return [*(Finding(USABLE, text) for text in [*because, *faults]), *repairs], False
    if late := [recording.late for recording in found.recordings if recording.late]:
        return [Finding(USABLE, late[0]), *repairs], False
    if exchanged:
        return [Finding(BAD, exchanged), *repairs], False
    causes = [Finding(USABLE, doubt) for doubt in agreement.doubts(arm)]
    driven = _driven_by_friction(found)
    named = agreement.runs_against(driven=True) if against else np.zeros_like(driven)
    if others := arm.named(driven & ~named):
        causes.insert(0, Finding(BAD, _driven(others)))
    if against:
        causes.insert(0, Finding(BAD, against))
    if not causes and unexplained:
        tilted = tilted_gravity(model, measurements_of(found.training))
        if tilted is not None and (error := _error_with(found, tilted)) < now:
            agreement = agreement._replace(turned=True, load=agreement.load._replace(gravity=tilted))
            gravity = agreement.gravity(arm)
    if not causes and gravity is None and (shifted := _shifted(found)):
        causes.append(Finding(USABLE, shifted))
    if unexplained:
        causes += [Finding(USABLE, text) for text in faults]
    if not causes and gravity is None and not faults:
        remarks = _odd_scale(found, agreement)
        if not remarks and found.quality.verdict != GOOD:
            remarks = _rotors(found)
        causes += [Finding(USABLE, text) for text in remarks]
    identifiable = (model.mapping[:, : links.size : links.shape[1]] != 0).any(0)  # masses of links, (J,)
    if not causes:
        masses = (float(x[identifiable, 0].sum()) for x in (links, arm.inertial_parameters))
        causes += implausible_mass(*masses)
    if gravity is not None:
        gravity += f"; mean nMSE would then be {shown(error)} instead of {shown(now)}"
        causes.insert(0, Finding(BAD, gravity))
    causes += [finding for finding in implausible_links(arm, links) if identifiable[finding.joint]]
    return [*causes, *repairs, *_offsets(found)], gravity is not None


def _odd_validation(found: IdentifiedArm, training: Agreement) -> list[str]:
    """A contradiction between the description and a validation recording, where training has none."""
    arm = found.model.arm

    def contradictions(agreement: Agreement) -> list[str]:
        texts = [agreement.exchanged(arm), agreement.gravity(arm), agreement.reversed(arm)]
        return [*filter(None, texts), *agreement.doubts(arm)]

    if contradictions(training):
        return []
    return [f"{x.name}: {text}" for x in found.validation for text in contradictions(x.agreement)][:1]


def _error_of(found: IdentifiedArm, model: TorqueModel, zeros: Array | float = 0.0) -> float:
    """Mean nMSE of the chosen method with another model or zeros, over the joints above their noise."""
    samples, held_out = (moved(measurements_of(x), zeros) for x in (found.training, found.validation))
    parameters = estimate(found.chosen.method, model, samples).parameters
    return found.quality.mean(score(model, parameters, held_out or samples))


def _error_with(found: IdentifiedArm, gravity: Array) -> float:
    """The same with another gravity [m/s²], (3,)."""
    turned = RigidBody(replace(found.model.arm, gravity=gravity))
    return _error_of(found, TorqueModel(turned, found.model.terms))


def _shifted(found: IdentifiedArm) -> str:
    """Remark that other zeros of the joints' positions explain much of the misfit; empty if they do not."""
    arm = found.model.arm
    zeros = shifted_zeros(found.model, measurements_of(found.training))
    each = zip(arm.joint_names, zeros.tolist(), arm.prismatic)
    shifts = [f"{name} by {zero:+.2g} {'m' if slides else 'rad'}" for name, zero, slides in each if zero]
    if not shifts:
        return ""
    error, now = _error_of(found, found.model, zeros), found.quality.judged.nmse_mean
    return (
        f"the encoder zero looks off: {listed(shifts)}; subtract this from the recorded positions, or "
        f"correct the joint's origin in the description; mean nMSE would then be {shown(error)} instead of "
        f"{shown(now)}"
    )


def _rotors(found: IdentifiedArm) -> list[str]:
    """Remark that rotor inertias, which the model lacks, explain most of the misfit."""
    terms = found.model.terms
    now = found.quality.mean(found.quality.judged)
    if terms.rotor_inertia:
        return []
    error = _error_of(found, TorqueModel(found.model.body, replace(terms, rotor_inertia=True)))
    if error >= _EXPLAINED * now:
        return []
    return [
        f"rotors explain the residuals: with model=motor_current the mean nMSE is {shown(error)} "
        f"instead of {shown(now)}; are these torques measured at the motors?"
    ]


def _driven_by_friction(found: IdentifiedArm) -> Array:
    """Whether each joint's friction of both kinds is clearly negative, (J,)."""
    chosen = found.chosen
    clear = chosen.parameters < -_SURE * chosen.deviation
    negative = {name for name, x in zip(chosen.names, clear.tolist()) if x}
    return np.array([{f"fv{j}", f"fc{j}"} <= negative for j in range(1, found.model.joints + 1)])


def _driven(names: str) -> str:
    """Remark on joints with such friction."""
    return (
        f"the friction of {names} would drive the motion: is the sign of the torque reversed? "
        f"{to_reverse(names)}"
    )


def _odd_scale(found: IdentifiedArm, agreement: Agreement) -> list[str]:
    """Remark on the joint whose torque is scaled differently from the others', by parameters they share.

    If two joints disagree, either torque may be wrong: the description decides. It is not enough on its own,
    since its masses may be wrong.
    """
    chosen = found.chosen
    arm = found.model.arm
    sums = found.chosen.sums
    squares = np.square(chosen.weights)
    moments = squares[:, None] * sums.moment
    turned = moments @ scaled_inverse(sums.weighted(chosen.weights)[0], _ROUNDING)
    noise = squares * sums.squares(chosen.parameters)  # without it, scales would be biased towards zero
    free = squares * sums.energy - (turned * moments).sum(1) - noise
    shared = (turned * (moments.sum(0) - moments)).sum(1)
    # information on each joint's scale, (J,): none if noise drowns it or no other joint shares its links
    known = (free > 0) & (shared > 0)
    free, shared = (np.where(known, x, 1.0) for x in (free, shared))
    scale = free / shared
    deviation = np.sqrt(chosen.inflation / free) * np.square(scale)
    off = np.abs(scale - 1)
    as_described = (np.abs(scale - agreement.load.scale) < _SCALE) & (agreement.sign > _ALIKE)
    odd = (off > np.maximum(_CLEAR * deviation, _SCALE)) & as_described
    if not odd.any():
        return []
    j = int(np.where(odd, off, 0.0).argmax())
    return [
        f"the torque of {arm.joint_names[j]} is {scale[j]:.2f} times what the other joints' torques and "
        "the description imply: wrong gain or unit? (robot.gains, or divide the column by this factor)"
    ]


def _offsets(found: IdentifiedArm) -> Iterator[Finding]:
    """Large torque offsets: the model includes them, but a tared sensor has none."""
    chosen = found.chosen
    arm = found.model.arm
    limits = np.where(np.isfinite(arm.torque_limit), arm.torque_limit, 0.0)
    for name, value, deviation in zip(chosen.names, chosen.parameters.tolist(), chosen.deviation.tolist()):
        if not name.startswith("fo"):
            continue
        j = joint_of(name)
        usual = found.quality.usual[j]
        unit = "N" if arm.prismatic[j] else "N·m"
        if abs(value) > max(_OFFSET * usual, _OFFSET_LIMIT * limits[j], _SURE * deviation):
            text = (
                f"its torque has an offset of {value:.2g} ± {deviation:.1g} {unit}, for a usual torque of "
                f"{usual:.2g} {unit}: the model includes it, but was the sensor tared?"
            )
            yield Finding(GOOD, text, j)
