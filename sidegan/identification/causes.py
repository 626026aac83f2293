"""Causes of a model's misfit: what the recordings' checks found, and what one fault in them would explain."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import reduce

import numpy as np

from sidegan.identification.estimate import estimate
from sidegan.identification.fit import covariance_of, reweighted, torque_errors
from sidegan.identification.gather import Gathered
from sidegan.identification.identified import IdentifiedArm, measurements_of
from sidegan.identification.model import TorqueModel
from sidegan.identification.payload import LOAD, gathered
from sidegan.identification.score import score, shown
from sidegan.identification.sums import Sums, scaled_inverse
from sidegan.identification.verdict import (
    BAD,
    GOOD,
    USABLE,
    Finding,
    implausible_links,
    implausible_mass,
    joint_of,
)
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.agreement import Agreement, agreement_of

_ROUNDING = 1e-10
_EXPLAINED = 0.5  # of an error is left at most where a fault in the recordings is believed
_SURE = 5.0  # deviations of a mass or an offset that is one
_CLEAR = 3.0  # of a scale that the description says too
_ALIKE = 0.98  # correlation with the description there
_SCALE = 0.03  # by which a joint's torque is off at least
_NOTABLE = 0.02  # of the arm's mass that a load has at least
_OFFSET, _OFFSET_LIMIT = 0.2, 0.02  # of a joint's usual torque, and of its limit, that an offset is told from


def causes_of(found: IdentifiedArm) -> tuple[list[Finding], bool]:
    """Findings against the recordings, the description or the links; whether gravity is another one.

    What would make others follow is told alone.
    """
    model, arm, links = found.model, found.model.arm, found.links
    remarks: dict[str, str] = {}
    for recording in found.recordings[::-1]:  # of a signal that several contradict, the first says so
        remarks |= recording.remarks
    mended = USABLE if found.quality.verdict == BAD else GOOD  # or the signal that they contradict is wrong
    told = [Finding(mended, text) for text in remarks.values()]
    if late := [recording.late for recording in found.recordings if recording.late]:
        return [Finding(USABLE, late[0]), *told], False
    agreement = agreement_of(model.body, [segment for each in found.training for segment in each.segments])
    if exchanged := agreement.exchanged(arm):
        return [Finding(BAD, exchanged), *told], False
    causes = [Finding(USABLE, doubt) for doubt in agreement.doubts(arm)]
    gravity = agreement.gravity(arm)
    if gravity is None and (against := agreement.reversed(arm, driven=True)):
        causes.insert(0, Finding(USABLE, against))
    if not causes and gravity is None:
        faults = _odd_scale(found, agreement)
        if not faults and found.quality.verdict != GOOD:
            faults = _rotors(found) or _changed_load(found)
        causes += [Finding(USABLE, text) for text in faults]
    torques_tell = (model.mapping[:, : links.size : links.shape[1]] != 0).any(0)  # masses of links, (J,)
    if not causes:
        masses = (float(x[torques_tell, 0].sum()) for x in (links, arm.inertial_parameters))
        causes += implausible_mass(*masses)
    if gravity is not None:
        turned = RigidBody(replace(arm, gravity=agreement.load.gravity))
        error = _error_of(found, TorqueModel(turned, model.terms))
        now = found.quality.judged.nmse_mean
        gravity += f"; mean nMSE would then be {shown(error)} instead of {shown(now)}"
        causes.insert(0, Finding(BAD, gravity))
    causes += [finding for finding in implausible_links(arm, links) if torques_tell[finding.joint]]
    return [*causes, *told, *_offsets(found)], gravity is not None


def _error_of(found: IdentifiedArm, model: TorqueModel) -> float:
    """Mean nMSE of the chosen method with another model, over the joints that noise does not drown."""
    samples, held_out = measurements_of(found.training), measurements_of(found.validation)
    parameters = estimate(found.chosen.method, model, samples).parameters
    return found.quality.mean(score(model, parameters, held_out or samples))


def _rotors(found: IdentifiedArm) -> list[str]:
    """That rotors, which the model is without, explain most of the misfit."""
    terms, now = found.model.terms, found.quality.mean(found.quality.judged)
    if terms.rotor_inertia:
        return []
    error = _error_of(found, TorqueModel(found.model.body, replace(terms, rotor_inertia=True)))
    if error >= _EXPLAINED * now:
        return []
    return [
        f"rotors explain the residuals: with model=motor_current the mean nMSE is {shown(error)} "
        f"instead of {shown(now)}; are these torques measured at the motors?"
    ]


def _odd_scale(found: IdentifiedArm, agreement: Agreement) -> list[str]:
    """The joint whose torque is at another scale than the others', by the parameters that they share.

    That of two joints which share parameters one is too large may be that the other is too small: the
    description says which. Alone it may be wrong about masses.
    """
    chosen, arm, sums = found.chosen, found.model.arm, found.chosen.sums
    squares = np.square(chosen.weights)
    moments = squares[:, None] * sums.moment
    turned = moments @ scaled_inverse(sums.weighted(chosen.weights)[0], _ROUNDING)
    free = squares * sums.energy - (turned * moments).sum(1)  # of each scale, beside all parameters, (J,)
    shared = (turned * (moments.sum(0) - moments)).sum(1)
    times = free / shared
    deviation = np.sqrt(chosen.inflation / free) * np.square(times)
    off = np.abs(times - 1)
    as_described = (np.abs(times - agreement.load.scale) < _SCALE) & (agreement.sign > _ALIKE)
    odd = (off > np.maximum(_CLEAR * deviation, _SCALE)) & as_described
    if not odd.any():
        return []
    j = int(np.where(odd, off, 0.0).argmax())
    return [
        f"the torque of {arm.joint_names[j]} is {times[j]:.2f} times what the other joints' torques and "
        "the description imply: wrong gain or unit? (robot.gains, or divide the column by this factor)"
    ]


def _changed_load(found: IdentifiedArm) -> list[str]:
    """The recording that another load than the others' explains."""
    if len(found.recordings) < 2:
        return []
    samples = [measurements_of([recording]) for recording in found.recordings]
    without, with_load = zip(*(gathered(found.model, sample, sample) for sample in samples))
    each = [_load(found.model.count, without, with_load, k) for k in range(len(samples))]
    if len(each) == 2:
        each = each[1:]  # which of both it is cannot be told
    mass, deviation, share, k = min(each, key=lambda one: one[2])
    least = max(_SURE * deviation, _NOTABLE * found.model.arm.inertial_parameters[:, 0].sum())
    if not (share < _EXPLAINED and abs(mass) > least):
        return []
    return [
        f"{found.recordings[k].name} was recorded with a different load than the others: {mass:+.2g} ± "
        f"{deviation:.1g} kg on {found.model.arm.link_names[-1]} explains it; identify from recordings "
        "with one load (+experiment=payload identifies the difference)"
    ]


def _load(
    count: int, without: Sequence[Gathered], with_load: Sequence[Gathered], k: int
) -> tuple[float, float, float, int]:
    """Mass in recording k beside the others and its deviation [kg]; the share of errors that it leaves; k."""
    parts = [*without[:k], with_load[k], *without[k + 1 :]]
    sums = reduce(Sums.plus, (part.sums for part in parts))
    plain = Sums(sums.information[:, :count, :count], sums.moment[:, :count], *sums[2:])
    fit, before = reweighted(sums), reweighted(plain)
    whole = Gathered(parts[k].model, sums, with_load[k].pieces, parts[k].samples, parts[k].reach)
    deviation = float(np.sqrt(covariance_of(sums, fit, torque_errors(whole, fit))[-LOAD, -LOAD]))
    empty = np.concatenate([before.parameters, np.zeros(LOAD)])
    left, now = (with_load[k].sums.squares(x) for x in (empty, fit.parameters))
    return float(fit.parameters[-LOAD]), deviation, float(np.exp(np.log(now / left).mean())), k


def _offsets(found: IdentifiedArm) -> Iterator[Finding]:
    """Offsets that are no small part of a joint's torque: the model holds them, a sensor should not."""
    chosen, arm = found.chosen, found.model.arm
    limits = np.where(np.isfinite(arm.torque_limit), arm.torque_limit, 0.0)
    each = zip(chosen.names, chosen.parameters.tolist(), chosen.deviation.tolist())
    for name, value, deviation in (one for one in each if one[0].startswith("fo")):
        j = joint_of(name)
        usual, unit = found.quality.usual[j], "N" if arm.prismatic[j] else "N·m"
        if abs(value) > max(_OFFSET * usual, _OFFSET_LIMIT * limits[j], _SURE * deviation):
            text = (
                f"its torque has an offset of {value:.2g} ± {deviation:.1g} {unit}, for a usual torque of "
                f"{usual:.2g} {unit}: the model includes it, but was the sensor tared?"
            )
            yield Finding(GOOD, text, j)
