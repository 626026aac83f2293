"""Torques that no drive of the arm gives: another unit, other gains, or another arm."""

import math

import torch

from sidegan.errors import RecordingError
from sidegan.recording.agreement import Agreement
from sidegan.recording.settings import Units
from sidegan.recording.statistics import Statistics
from sidegan.robot import Arm

_STRONG = 3.0  # times a torque limit: no drive is overloaded that much for a hundredth of the time
_HEAVY = 30.0  # times what the description's links need; their masses may be a guess, but not that bad a one
_THOUSANDTH = {"torque": "mNm", "current": "mA"}


def refuse_overload(statistics: Statistics, arm: Arm, agreement: Agreement, units: Units) -> None:
    """Refuse torques far beyond the arm's limits; without limits, far beyond what its description needs.

    Limits that the description's own links exceed in the same motion stand for none.

    Raises:
        RecordingError: naming the joint, its torque, and the setting that is likely to be wrong.
    """
    limited = bool(arm.torque_limit.isfinite().any() and (agreement.needed <= arm.torque_limit).all())
    most, than = (_STRONG, "its limit") if limited else (_HEAVY, "what the description's links need")
    heavier = torch.full_like(agreement.usual, agreement.heavier)
    share = agreement.usual / arm.torque_limit if limited else heavier
    if not (share > most).any():
        return
    j, measured = int(share.argmax()), statistics.load
    smaller, unit = _THOUSANDTH[measured], "N" if arm.prismatic[j] else "N·m"
    if _HEAVY < float(share[j]) <= 1e3 * most and getattr(units, measured) != smaller:
        suspicion = f"is the {measured} in {smaller}? (recording.units.{measured}={smaller})"
    elif measured == "current":
        suspicion = "are the gains (robot.gains) and the order of the joints those of this arm?"
    else:
        suspicion = "is it in N·m, and in this order of the joints? (a current is named by recording.current)"
    each = zip(arm.joint_names, agreement.usual.tolist(), (share > most).tolist())
    limits = ", ".join(f"{name}: {math.ceil(usual)}" for name, usual, far in each if far)
    raise RecordingError(
        f"{statistics.name}: the torque of {arm.joint_names[j]} reaches {agreement.usual[j]:.4g} {unit}, "
        f"{share[j]:.3g} times {than}: {suspicion}; if the arm does that, set its limits: "
        f"'robot.limits.effort={{{limits}}}'"
    )
