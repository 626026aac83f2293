"""Causes in what torques say of the description: scales, signs and offsets of torques, and other links."""

import math

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.settings_text import setting_name
from sidegan.identification import thresholds
from sidegan.identification.estimate import nmse_text, score
from sidegan.identification.fit import best_combination
from sidegan.identification.identified import measurements_of
from sidegan.identification.misfit import Misfit
from sidegan.identification.sums import scaled_inverse
from sidegan.identification.verdict import BAD, GOOD, USABLE, Finding, joint_of
from sidegan.recording.agreement import to_reverse
from sidegan.robot import Arm, placeholder_links


def driving_friction(misfit: Misfit, named: Array) -> list[Finding]:
    """Joints, other than the named ones, (J,), whose friction of both kinds is clearly negative."""
    chosen = misfit.found.chosen
    clear = chosen.parameters < -thresholds.CERTAIN * chosen.deviation
    negative = {name for name, x in zip(chosen.names, clear.tolist()) if x}
    driven = [{f"fv{j}", f"fc{j}"} <= negative for j in range(1, misfit.model.joints + 1)]
    odd = np.array(driven) & ~named
    if not odd.any():
        return []
    remedy = to_reverse(misfit.arm, odd, misfit.agreement.settings.reverse)
    text = f"the friction of {misfit.arm.named(odd)} would drive the motion"
    return [Finding(BAD, f"{text}: is the sign of the torque reversed? {remedy}")]


def odd_scale(misfit: Misfit) -> list[Finding]:
    """The joint whose torque is scaled differently from the others', by parameters they share.

    If two joints disagree, either torque may be wrong: the description decides. It is not enough on its own,
    since its masses may be wrong.
    """
    chosen, agreement = misfit.found.chosen, misfit.agreement
    sums = chosen.sums
    squares = np.square(chosen.weights)
    moments = squares[:, None] * sums.moment
    turned = moments @ scaled_inverse(sums.weighted(chosen.weights)[0])
    noise = squares * sums.squares(chosen.parameters)  # without it, scales would be biased towards zero
    free = squares * sums.energy - (turned * moments).sum(1) - noise
    shared = (turned * (moments.sum(0) - moments)).sum(1)
    # information on each joint's scale, (J,): none if noise drowns it or no other joint shares its links
    known = (free > 0) & (shared > 0)
    free, shared = (np.where(known, x, 1.0) for x in (free, shared))
    scale = free / shared
    deviation = np.sqrt(chosen.inflation / free) * np.square(scale)
    off = np.abs(scale - 1)
    as_described = np.abs(scale - agreement.fit.scale) < thresholds.ODD_SCALE
    as_described &= agreement.sign > thresholds.AS_DESCRIBED
    odd = off > np.maximum(thresholds.ODD_SCALE_CERTAIN * deviation, thresholds.ODD_SCALE)
    odd &= as_described
    if not odd.any():
        return []
    j = int(np.where(odd, off, 0.0).argmax())
    text = (
        f"the torque of {misfit.arm.joint_names[j]} is {scale[j]:.2f} times what the other joints' "
        f"torques and the description imply: wrong gain or unit? ({setting_name('robot.gains')}, or divide "
        "the column by this factor)"
    )
    return [Finding(USABLE, text)]


def offsets(misfit: Misfit) -> list[Finding]:
    """Large torque offsets: the model includes them, but a tared sensor has none."""
    chosen, arm, found = misfit.found.chosen, misfit.arm, []
    for name, value, deviation in zip(chosen.names, chosen.parameters.tolist(), chosen.deviation.tolist()):
        if not name.startswith("fo"):
            continue
        j = joint_of(name)
        usual, limit = misfit.quality.usual[j], arm.torque_limit[j]
        least = max(thresholds.NOTABLE_OFFSET * usual, thresholds.CERTAIN * deviation)
        if math.isfinite(limit):
            least = max(least, thresholds.NOTABLE_OFFSET_OF_LIMIT * limit)
        if abs(value) > least:
            unit = "N" if arm.prismatic[j] else "N·m"
            text = (
                f"its torque has an offset of {value:.2g} ± {deviation:.1g} {unit}, for a usual torque of "
                f"{usual:.2g} {unit}: the model includes it, but was the sensor tared?"
            )
            found.append(Finding(GOOD, text, j))
    return found


def differences(misfit: Misfit) -> list[Finding]:
    """What differs from the description: the simplest that predicts as well as the model.

    Friction alone; if that is clearly worse, a scale of all torques, a load on the last link, or one link.
    """
    arm, quality = misfit.arm, misfit.quality
    if quality.verdict == BAD or placeholder_links(arm) or not arm.inertial_parameters.any():
        return []
    described, own = quality.mean(quality.nominal_score), quality.mean(quality.judged)
    if quality.as_good(quality.nominal_score):
        errors = f"mean nMSE {nmse_text(described)} against {nmse_text(own)}"
        whose = "the description is right: its own" if quality.verdict == GOOD else "the description's own"
        return [Finding(GOOD, f"{whose} links predict as well, with friction fitted ({errors})", leads=True)]
    if described < max(thresholds.DIFFERENT * own, thresholds.NOTABLE_NMSE):
        return []
    return _other_scale(misfit) or _other_links(misfit)


def _other_scale(misfit: Misfit) -> list[Finding]:
    """A scale of all of the description's torques."""
    nominal = misfit.model.nominal
    if (scale := _alone(misfit, 0 * nominal, nominal[:, None])) is None:
        return []
    text = (
        f"all torques are {scale[0][0]:.2f} times the description's: drive constants or masses? "
        f"({setting_name('robot.gains')}, or the description's masses)"
    )
    return [Finding(USABLE, text, leads=True)]


def _other_links(misfit: Misfit) -> list[Finding]:
    """A load on the last link, or else the links of which one alone may differ, best first."""
    model, arm = misfit.model, misfit.arm
    links = []
    for j in reversed(range(model.joints)):
        link = _alone(misfit, model.nominal, model.mapping[:, 10 * j : 10 * j + 10])
        if link is None:
            continue
        difference, deviation, error = link
        (mass, *moment), name = difference[:4].tolist(), arm.link_names[j]
        known = abs(mass) > misfit.least_mass(deviation[0])
        if known and mass > 0 and j == model.joints - 1:
            centre = ", ".join(f"{x / mass:.2g}" for x in moment)
            text = f"a load of {mass:.2g} kg at ({centre}) m on {name} explains the difference from the "
            return [Finding(GOOD, f"{text}description: is the tool in it?", leads=True)]
        name += f" ({abs(mass):.2g} kg {'more' if mass > 0 else 'less'})" if known else ""
        links.append((error, name))
    text = f"{' or '.join(name for _, name in sorted(links))} alone differs from the description"
    return [Finding(GOOD, text, leads=True)] if links else []


def _alone(misfit: Misfit, fixed: Array, columns: Array) -> tuple[Array, Array, float] | None:
    """Best combination of columns (P, K) beside fixed parameters (P,), with friction fitted.

    Its weights (K + terms), their deviations and the mean nMSE; None unless it predicts as well as the model.
    """
    model, quality, found = misfit.model, misfit.quality, misfit.found
    free = np.concatenate([columns, model.terms_mapping], 1)
    parameters, weights, covariance = best_combination(found.chosen.sums, found.chosen.certainty, fixed, free)
    errors = score(model, parameters, measurements_of(found.validation or found.training))
    if not quality.as_good(errors):
        return None
    return weights, np.sqrt(covariance.diagonal()), quality.mean(errors)


def implausible_mass(found: float, described: float) -> list[Finding]:
    """A total mass [kg] of a different order of magnitude than the description's."""
    most = thresholds.IMPLAUSIBLE_MASS
    if not described > 0 or described / most <= found <= described * most:
        return []
    units = f"recording.units.torque or recording.units.current, {setting_name('robot.gains')}"
    text = f"the links weigh {found:.3g} kg, {described:.3g} kg in the description"
    return [Finding(USABLE, f"{text}: are the torques in another unit? ({units})")]


def implausible_links(arm: Arm, links: Array) -> list[Finding]:
    """Links (J, 10) with an implausible mass or centre of mass."""
    described = arm.inertial_parameters[:, 0]
    whole = described.sum()
    reach = np.linalg.norm(arm.translation, axis=1).sum() + np.linalg.norm(arm.tip)
    found = []
    for j, (mass, *moment) in enumerate(links[:, :4].tolist()):
        away = math.hypot(*moment) / mass if mass > 0 else 0.0
        if mass > max(thresholds.IMPLAUSIBLE_MASS * described[j], whole) > 0:
            text = f"{arm.link_names[j]} weighs {mass:.3g} kg, {described[j]:.3g} kg in the description"
            found.append(Finding(USABLE, text, j))
        if away > reach > 0 and mass > thresholds.NOTABLE_MASS * whole:
            text = f"the centre of mass of {arm.link_names[j]} is {away:.3g} m away, beyond the arm's reach"
            found.append(Finding(BAD, text, j))
    return found
