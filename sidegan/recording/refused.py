"""Recordings that cannot be used: other units than are declared, no motion, torques that no drive gives."""

import math

import numpy as np

from sidegan.base.arrays import Array
from sidegan.errors import RecordingError
from sidegan.recording.agreement import Agreement
from sidegan.recording.statistics import SLOWEST, Signal, Statistics
from sidegan.recording.units import Units
from sidegan.robot import Arm

DEGREES, MILLIMETRES = 180 / math.pi, 1e3
HARDLY = 0.02  # [rad or m] by which a joint moves at least where there is something to identify
_FAR = 1.5  # times a joint limit, beyond which positions are hardly in radians
_TURN = 2.1 * math.pi  # [rad] that nothing moves from zero without a reason
_LONG = 5.0  # times the limit of a joint that slides, beyond which positions are hardly in metres
_PART = 0.1  # of its range, that a joint slides through at least where it is used
_COUNTED = 10.0  # times a joint limit, beyond which most positions are neither in degrees nor in radians
_TINY = 2 * math.pi / DEGREES  # [rad] that a turn becomes when radians are taken for degrees
_USUAL = 0.15  # [s] between samples: the first unit of time by which they are no further apart is likely
_STRONG = 3.0  # times a torque limit: no drive is overloaded that much for a hundredth of the time
_HEAVY = 30.0  # times what the description's links need; their masses may be a guess, but not that bad a one
_THOUSANDTH = {"torque": "mNm", "current": "mA"}


def refuse_wrong_units(statistics: Statistics, arm: Arm, units: Units) -> None:
    """Refuse positions and time stamps that make sense in another unit than the declared one only."""
    name, position = statistics.name, statistics.signals["position"]
    if statistics.step > SLOWEST:
        raw = statistics.step / units.factor("time")
        likely = next((unit for unit in ("ms", "us") if raw * Units.of_time(unit) <= _USUAL), "ns")
        raise RecordingError(
            f"{name}: samples are {statistics.step:.3g} s apart: are the time stamps in another unit? "
            f"(recording.units.time={likely})"
        )
    for doubt in (_angles, _lengths, _counts):
        if said := doubt(position, arm, units):
            raise RecordingError(f"{name}: {said}")


def _angles(position: Signal, arm: Arm, units: Units) -> str | None:
    """Whether angles are degrees taken for radians, or the other way round; None where they are not."""
    turning, reach, limit = ~arm.prismatic, position.largest, _limit(arm)
    far = turning & (reach > _FAR * limit) & (reach > _TURN)
    if units.angle != "deg" and far.any() and (reach[turning] / DEGREES <= limit[turning]).all():
        return f"{_reaches(position, arm, far)}: are these degrees? (recording.units.angle=deg)"
    span = (position.upper - position.lower)[turning]
    if units.angle == "deg" and len(span) and 0 < span.max() < _TINY:
        turned = f"{span.max() * DEGREES:.3g}°"
        return f"no joint turns more than {turned}: are these radians? (recording.units.angle=rad)"
    return None


def _lengths(position: Signal, arm: Arm, units: Units) -> str | None:
    """Whether lengths are millimetres taken for metres, or the other way round; None where they are not."""
    sliding, reach, limit = arm.prismatic, position.largest, _limit(arm)
    far = sliding & (reach > _LONG * limit)
    if units.length != "mm" and far.any() and (reach[far] / MILLIMETRES <= _FAR * limit[far]).all():
        return f"{_reaches(position, arm, far)}: are these millimetres? (recording.units.length=mm)"
    span, whole = position.upper - position.lower, arm.position_upper - arm.position_lower
    short = sliding & (MILLIMETRES * reach <= _FAR * limit) & (MILLIMETRES * span > _PART * whole)
    if units.length == "mm" and short.any():
        slid = f"{arm.named(short)} slides no more than {span[short].max() * MILLIMETRES:.3g} mm"
        return f"{slid}: are these metres? (recording.units.length=m)"
    return None


def _counts(position: Signal, arm: Arm, units: Units) -> str | None:
    """Whether positions are counts of encoders, which no unit makes angles of; None where they are not."""
    if units.position is not None:
        return None
    far = position.largest > _COUNTED * _limit(arm)
    if 2 * far.sum() <= arm.joints:
        return None
    lower, upper = (x / units.factor("position") for x in (position.lower, position.upper))
    per_turn = 2 ** math.ceil(math.log2(max(float(upper.max()), 2)))
    zero = per_turn // 2 if (lower >= 0).all() else 0
    return (
        f"{_reaches(position, arm, far)}, which no unit explains: are these encoder counts? If so, give the "
        "counts per turn and the reading at joint position zero, for example "
        f"'recording.units.position={{per_turn: {per_turn}, zero: {zero}}}'"
    )


def _limit(arm: Arm) -> Array:
    """How far joints may be from zero [rad or m], (J,)."""
    return np.maximum(np.abs(arm.position_lower), np.abs(arm.position_upper))


def _reaches(position: Signal, arm: Arm, far: Array) -> str:
    """How far the first of some joints reaches, and might."""
    j = int(far.argmax())
    unit = "m" if arm.prismatic[j] else "rad"
    reach, limit = position.largest[j], _limit(arm)[j]
    return f"{arm.joint_names[j]} reaches {reach:.4g} {unit}, its limit is {limit:.4g} {unit}"


def refuse_idle(statistics: Statistics, arm: Arm) -> None:
    """Refuse a recording without motion or torque, or whose velocities are none."""
    file, signals = statistics.name, statistics.signals
    span = signals["position"].upper - signals["position"].lower
    if (span < HARDLY).all():
        raise RecordingError(
            f"{file} hardly moves: no joint by more than {span.max():.2g} rad or m; identification needs "
            "motions through a good part of the arm's range: +experiment=excite"
        )
    name = statistics.load
    signal = signals[name]
    if not signal.largest.max() > 0:
        raise RecordingError(f"{file}: every {name} is zero")
    if signal.constant.any():
        joints = arm.named(signal.constant)
        raise RecordingError(
            f"{file}: the {name} of {joints} is constant over the whole recording; a joint that never moves "
            f"can be left out: 'recording.without=[{joints.replace(', ', ',')}]'"
        )
    for rate in [name for name in ("velocity", "acceleration") if name in signals]:
        dead = signals[rate].constant & (span >= HARDLY)
        if dead.any():
            raise RecordingError(
                f"{file}: the {rate} of {arm.named(dead)} is constant while it moves; "
                f"recording.{rate}=null derives it instead"
            )


def refuse_overload(statistics: Statistics, arm: Arm, agreement: Agreement, units: Units) -> None:
    """Refuse torques far beyond the arm's limits; without limits, far beyond what its description needs.

    Limits that the description's own links exceed in the same motion stand for none.
    """
    limited = np.isfinite(arm.torque_limit).any() and (agreement.needed <= arm.torque_limit).all()
    most, than = (_STRONG, "its limit") if limited else (_HEAVY, "what the description predicts")
    heavier = np.full_like(agreement.usual, agreement.heavier)
    share = agreement.usual / arm.torque_limit if limited else heavier
    if not (share > most).any():
        return
    j = int(share.argmax())
    unit = "N" if arm.prismatic[j] else "N·m"
    measured = statistics.load
    smaller = _THOUSANDTH[measured]
    if _HEAVY < share[j] <= 1e3 * most and getattr(units, measured) != smaller:
        suspicion = f"is the {measured} in {smaller}? (recording.units.{measured}={smaller})"
    elif measured == "current":
        suspicion = "are the drive gains (robot.gains) and the joint order right?"
    else:
        suspicion = "is it in N·m, and the joint order right? (a current is named by recording.current)"
    each = zip(arm.joint_names, agreement.usual.tolist(), (share > most).tolist())
    limits = ", ".join(f"{name}: {math.ceil(usual)}" for name, usual, far in each if far)
    raise RecordingError(
        f"{statistics.name}: the torque of {arm.joint_names[j]} reaches {agreement.usual[j]:.4g} {unit}, "
        f"{share[j]:.3g} times {than}: {suspicion}; if the arm can do that, raise its limits: "
        f"'robot.limits.effort={{{limits}}}'"
    )
