"""Causes of a model's misfit: the order in which they are sought, and which of them leave others out."""

import numpy as np

from sidegan.identification.changes import contacts_and_drifts, held_loads, other_load_or_friction
from sidegan.identification.description import (
    differences,
    driving_friction,
    implausible_links,
    implausible_mass,
    odd_scale,
    offsets,
)
from sidegan.identification.identified import IdentifiedArm
from sidegan.identification.misfit import Misfit
from sidegan.identification.refits import (
    coupled_joints,
    encoder_zeros,
    other_gravity,
    rotor_inertias,
    tilted_base,
)
from sidegan.identification.verdict import BAD, GOOD, USABLE, Finding


def causes_of(found: IdentifiedArm) -> tuple[list[Finding], bool]:
    """Findings against the recordings, the description or the links; whether gravity points elsewhere.

    A fault that would cause the others is reported alone.
    """
    remarks: dict[str, str] = {}
    for recording in found.recordings[::-1]:  # reversed: the first recording's remark on a signal wins
        remarks |= recording.remarks
    repairs = [Finding(GOOD, text) for text in remarks.values()]
    poor = found.quality.verdict != GOOD
    twice = dict.fromkeys(text for recording in found.recordings for text in recording.twice)
    if twice and poor:
        return [*(Finding(BAD, text) for text in twice), *repairs], False

    misfit, arm = Misfit(found), found.model.arm
    agreement = misfit.agreement
    exchanged = agreement.exchanged(arm)
    gravity = other_gravity(misfit, agreement)
    against = None if gravity else agreement.reversed(arm, driven=True)
    unexplained = poor and not (exchanged or gravity or against)
    faults = [Finding(USABLE, f"{x.name}: {text}") for x in found.recordings for text in x.faults]
    doubts = [Finding(USABLE, text) for text in agreement.doubts(arm)]
    if unexplained:
        changes = other_load_or_friction(misfit)
        if not (changes or faults or doubts):  # which look like disturbances
            changes = held_loads(misfit) or contacts_and_drifts(misfit)
        if changes:
            return [*changes, *faults, *repairs], False
    if late := [recording.late for recording in found.recordings if recording.late]:
        return [Finding(USABLE, late[0]), *repairs], False
    if exchanged:
        return [Finding(BAD, exchanged), *repairs], False

    causes = [Finding(BAD, against)] if against else []
    named = agreement.runs_against(driven=True) if against else np.zeros(arm.joints, dtype=bool)
    causes += [*driving_friction(misfit, named), *doubts]
    if not causes and unexplained:
        gravity = tilted_base(misfit)
    if not (causes or gravity):
        causes = encoder_zeros(misfit)
    if unexplained:
        causes += faults
    if not (causes or gravity or faults):
        causes = odd_scale(misfit)
        if poor:
            causes = causes or rotor_inertias(misfit) or coupled_joints(misfit)
    identifiable = (found.model.mapping[:, : 10 * arm.joints : 10] != 0).any(0)  # masses of links, (J,)
    if not causes:
        masses = (float(x[identifiable, 0].sum()) for x in (found.links, arm.inertial_parameters))
        causes = implausible_mass(*masses)
    if not (causes or gravity):
        causes = differences(misfit)
    causes = [*gravity, *causes]
    causes += [finding for finding in implausible_links(arm, found.links) if identifiable[finding.joint]]
    faulty = any(cause.level != GOOD for cause in causes)
    return [*causes, *repairs, *([] if faulty else offsets(misfit))], bool(gravity)
