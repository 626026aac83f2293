"""Causes of a model's misfit: faults found when checking the recordings, and faults that would explain it."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.identification.disturbances import disturbances
from sidegan.identification.estimate import estimate, nmse_text, score
from sidegan.identification.fit import constrained, least_residual
from sidegan.identification.identified import IdentifiedArm, measurements_of
from sidegan.identification.model import TorqueModel
from sidegan.identification.refits import (
    change_between,
    coupled,
    held_load,
    moved,
    shifted_zeros,
    tilted_gravity,
)
from sidegan.identification.sums import scaled_inverse
from sidegan.identification.verdict import BAD, GOOD, USABLE, Finding, joint_of
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.agreement import Agreement, agreement_of, to_reverse
from sidegan.robot import Arm, placeholder_links

_ROUNDING = 1e-10
_EXPLAINED = 0.5  # share of the error that may remain if rotors are to explain it
_SURE = 5.0  # standard deviations from zero at which negative friction or an offset is significant
_CLEAR = 3.0  # standard deviations from one at which a torque scale is, if the description agrees
_ALIKE = 0.98  # correlation with the description's torque that counts as agreement
_SCALE = 0.03  # smallest scale error of a joint's torque that is reported
_OFFSET, _OFFSET_LIMIT = 0.2, 0.02  # smallest offset reported: share of the usual torque, and of its limit
_MASSES = 10.0  # ratio to the description's mass beyond which a mass is implausible
# Least nMSE of the description's links from which their difference is sought: over the model's, and as is.
_DIFFERS, _NOTABLE_ERROR = 3.0, 0.005
_NOTABLE = 0.02  # least mass of a link whose centre is checked, as a share of the arm's


def causes_of(found: IdentifiedArm) -> tuple[list[Finding], bool]:
    """Findings against the recordings, the description or the links; whether gravity points elsewhere.

    A fault that would cause the others is reported alone.
    """
    model, arm = found.model, found.model.arm
    unused: dict[str, str] = {}
    for recording in found.recordings[::-1]:  # reversed: the first recording's remark on a signal wins
        unused |= recording.remarks
    repairs = [Finding(GOOD, text) for text in unused.values()]
    twice = dict.fromkeys(text for recording in found.recordings for text in recording.twice)
    if twice and found.quality.verdict != GOOD:
        return [*(Finding(BAD, text) for text in twice), *repairs], False
    parts = [x for recording in found.training for x in recording.segments]
    agreement = agreement_of(model.body, parts, found.training[0].agreement.settings)
    exchanged, gravity = agreement.exchanged(arm), agreement.gravity(arm)
    now = error = found.quality.judged.nmse_mean
    if gravity and (error := _error_with(found, agreement.load.gravity)) > now:
        gravity = None  # other faults look like it to the description, but not to a model
    against = None if gravity else agreement.reversed(arm, driven=True)
    unexplained = found.quality.verdict != GOOD and not (exchanged or gravity or against)
    faults = [Finding(USABLE, f"{x.name}: {text}") for x in found.recordings for text in x.faults]
    doubts = agreement.doubts(arm)
    if unexplained:
        because = change_between(found)
        if not (because or faults or doubts):  # which look like disturbances
            because = [text for x in found.recordings for text in held_load(found, x)] or disturbances(found)
        if because:
            return [*(Finding(USABLE, text) for text in because), *faults, *repairs], False
    if late := [recording.late for recording in found.recordings if recording.late]:
        return [Finding(USABLE, late[0]), *repairs], False
    if exchanged:
        return [Finding(BAD, exchanged), *repairs], False
    named = agreement.runs_against(driven=True) if against else np.zeros(arm.joints, dtype=bool)
    reversals = [against, _driving_friction(found, named)]
    causes = [Finding(BAD, text) for text in reversals if text]
    causes += [Finding(USABLE, doubt) for doubt in doubts]
    if not causes and unexplained:
        tilted = tilted_gravity(model, measurements_of(found.training))
        if tilted is not None and (error := _error_with(found, tilted)) < now:
            agreement = agreement._replace(turned=True, load=agreement.load._replace(gravity=tilted))
            gravity = agreement.gravity(arm)
    if not causes and gravity is None and (shifted := _shifted(found)):
        causes.append(Finding(USABLE, shifted))
    if unexplained:
        causes += faults
    if not causes and gravity is None and not faults:
        remark = _odd_scale(found, agreement)
        if not remark and found.quality.verdict != GOOD:
            remark = _rotors(found) or _coupled(found)
        causes += [Finding(USABLE, remark)] if remark else []
    identifiable = (model.mapping[:, : 10 * arm.joints : 10] != 0).any(0)  # masses of links, (J,)
    if not causes:
        masses = (float(x[identifiable, 0].sum()) for x in (found.links, arm.inertial_parameters))
        causes += implausible_mass(*masses)
    if not causes and gravity is None:
        causes += _differences(found)
    if gravity is not None:
        gravity += f"; mean nMSE would then be {nmse_text(error)} instead of {nmse_text(now)}"
        causes.insert(0, Finding(BAD, gravity))
    causes += [finding for finding in implausible_links(arm, found.links) if identifiable[finding.joint]]
    faulty = any(cause.level != GOOD for cause in causes)
    return [*causes, *repairs, *([] if faulty else _offsets(found))], gravity is not None


def _error_of(found: IdentifiedArm, model: TorqueModel, zeros: Array | float = 0.0) -> float:
    """Mean nMSE of the chosen method with another model or zeros, over the joints above their noise."""
    samples, held_out = (moved(measurements_of(x), zeros) for x in (found.training, found.validation))
    parameters = estimate(found.chosen.method, model, samples).parameters
    return found.quality.mean(score(model, parameters, held_out or samples))


def _error_with(found: IdentifiedArm, gravity: Array) -> float:
    """Mean nMSE of the chosen method with another gravity [m/s²], (3,)."""
    turned = RigidBody(replace(found.model.arm, gravity=gravity))
    return _error_of(found, TorqueModel(turned, found.model.terms))


def _coupled(found: IdentifiedArm) -> str:
    """Remark that joints' motions or torques are coupled, with the settings that uncouple them; or empty."""
    coupling = coupled(found.model, measurements_of(found.training))
    if coupling is None:
        return ""
    settings = found.training[0].agreement.settings
    return f"{coupling[0]}: {settings.coupled(found.model.arm.joint_names, *coupling[1:])} uncouples them"


def _differences(found: IdentifiedArm) -> list[Finding]:
    """What differs from the description: the simplest that predicts as well as the model.

    Friction alone; if that is clearly worse, a scale of all torques, a load on the last link, or one link.
    """
    model, quality, chosen = found.model, found.quality, found.chosen
    arm, described = model.arm, quality.mean(quality.nominal_score)
    if quality.verdict == BAD or placeholder_links(arm) or not arm.inertial_parameters.any():
        return []
    if quality.as_good(quality.nominal_score):
        errors = f"mean nMSE {nmse_text(described)} against {nmse_text(quality.mean(quality.judged))}"
        whose = "the description is right: its own" if quality.verdict == GOOD else "the description's own"
        return [Finding(GOOD, f"{whose} links predict as well, with friction fitted ({errors})", leads=True)]
    if described < max(_DIFFERS * quality.mean(quality.judged), _NOTABLE_ERROR):
        return []
    samples = measurements_of(found.validation or found.training)
    certainty = np.minimum(chosen.certainty, 1 / least_residual(chosen.sums))
    terms = np.eye(model.count)[:, model.rigid :]

    def alone(fixed: Array, columns: Array) -> tuple[float, Array, Array] | None:
        """Mean nMSE of the best combination with columns (P, K), its weights, and their σ; if as good."""
        free = np.concatenate([columns, terms], 1)
        parameters, x, covariance = constrained(chosen.sums, certainty, fixed, free)
        errors = score(model, parameters, samples)
        return (quality.mean(errors), x, np.sqrt(covariance.diagonal())) if quality.as_good(errors) else None

    if scale := alone(0 * model.nominal, model.nominal[:, None]):
        text = f"all torques are {scale[1][0]:.2f} times the description's: drive constants or masses?"
        return [Finding(USABLE, f"{text} (robot.gains, or the description's masses)", leads=True)]
    links = []
    for j in reversed(range(model.joints)):
        if (one := alone(model.nominal, model.mapping[:, 10 * j : 10 * j + 10])) is None:
            continue
        error, x, deviation = one
        (mass, *moment), name = x[:4].tolist(), arm.link_names[j]
        known = abs(mass) > max(_SURE * deviation[0], _NOTABLE * arm.inertial_parameters[:, 0].sum())
        if known and mass > 0 and j == model.joints - 1:
            centre = ", ".join(f"{x / mass:.2g}" for x in moment)
            text = f"a load of {mass:.2g} kg at ({centre}) m on {name} explains the difference from the "
            return [Finding(GOOD, f"{text}description: is the tool in it?", leads=True)]
        name += f" ({abs(mass):.2g} kg {'more' if mass > 0 else 'less'})" if known else ""
        links.append((error, name))
    text = f"{' or '.join(name for _, name in sorted(links))} alone differs from the description"
    return [Finding(GOOD, text, leads=True)] if links else []


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
        f"correct the joint's origin in the description; mean nMSE would then be {nmse_text(error)} instead of "
        f"{nmse_text(now)}"
    )


def _rotors(found: IdentifiedArm) -> str:
    """Remark that rotor inertias, which the model lacks, explain most of the misfit; empty if not."""
    terms = found.model.terms
    now = found.quality.mean(found.quality.judged)
    if terms.rotor_inertia:
        return ""
    error = _error_of(found, TorqueModel(found.model.body, replace(terms, rotor_inertia=True)))
    if error >= _EXPLAINED * now:
        return ""
    return (
        f"rotors explain the residuals: with model=motor_current the mean nMSE is {nmse_text(error)} "
        f"instead of {nmse_text(now)}; are these torques measured at the motors?"
    )


def _driving_friction(found: IdentifiedArm, named: Array) -> str:
    """Remark on joints, other than the named ones, (J,), whose friction of both kinds is clearly negative."""
    chosen = found.chosen
    clear = chosen.parameters < -_SURE * chosen.deviation
    negative = {name for name, x in zip(chosen.names, clear.tolist()) if x}
    driven = [{f"fv{j}", f"fc{j}"} <= negative for j in range(1, found.model.joints + 1)]
    names = found.model.arm.named(np.array(driven) & ~named)
    return names and (
        f"the friction of {names} would drive the motion: is the sign of the torque reversed? "
        f"{to_reverse(names)}"
    )


def _odd_scale(found: IdentifiedArm, agreement: Agreement) -> str:
    """Remark on the joint whose torque is scaled differently from the others', by parameters they share.

    If two joints disagree, either torque may be wrong: the description decides. It is not enough on its own,
    since its masses may be wrong.
    """
    chosen = found.chosen
    sums = chosen.sums
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
        return ""
    j = int(np.where(odd, off, 0.0).argmax())
    return (
        f"the torque of {found.model.arm.joint_names[j]} is {scale[j]:.2f} times what the other joints' "
        "torques and the description imply: wrong gain or unit? (robot.gains, or divide the column by this "
        "factor)"
    )


def _offsets(found: IdentifiedArm) -> Iterator[Finding]:
    """Large torque offsets: the model includes them, but a tared sensor has none."""
    chosen, arm = found.chosen, found.model.arm
    for name, value, deviation in zip(chosen.names, chosen.parameters.tolist(), chosen.deviation.tolist()):
        if not name.startswith("fo"):
            continue
        j = joint_of(name)
        usual, limit = found.quality.usual[j], arm.torque_limit[j]
        least = max(_OFFSET * usual, _SURE * deviation, _OFFSET_LIMIT * limit if math.isfinite(limit) else 0)
        if abs(value) > least:
            unit = "N" if arm.prismatic[j] else "N·m"
            text = (
                f"its torque has an offset of {value:.2g} ± {deviation:.1g} {unit}, for a usual torque of "
                f"{usual:.2g} {unit}: the model includes it, but was the sensor tared?"
            )
            yield Finding(GOOD, text, j)


def implausible_mass(found: float, described: float) -> list[Finding]:
    """Finding on a total mass [kg] of a different order of magnitude than the description's."""
    if not described > 0 or described / _MASSES <= found <= described * _MASSES:
        return []
    units = "recording.units.torque or recording.units.current, robot.gains"
    text = f"the links weigh {found:.3g} kg, {described:.3g} kg in the description"
    return [Finding(USABLE, f"{text}: are the torques in another unit? ({units})")]


def implausible_links(arm: Arm, links: Array) -> list[Finding]:
    """Findings on links (J, 10) with an implausible mass or centre of mass."""
    described = arm.inertial_parameters[:, 0]
    whole = described.sum()
    reach = np.linalg.norm(arm.translation, axis=1).sum() + np.linalg.norm(arm.tip)
    found = []
    for j, (mass, *moment) in enumerate(links[:, :4].tolist()):
        away = math.hypot(*moment) / mass if mass > 0 else 0.0
        if mass > max(_MASSES * described[j], whole) > 0:
            text = f"{arm.link_names[j]} weighs {mass:.3g} kg, {described[j]:.3g} kg in the description"
            found.append(Finding(USABLE, text, j))
        if away > reach > 0 and mass > _NOTABLE * whole:
            text = f"the centre of mass of {arm.link_names[j]} is {away:.3g} m away, beyond the arm's reach"
            found.append(Finding(BAD, text, j))
    return found
