"""Refusal of unusable recordings: wrong units, no motion, impossible torques."""

import math
from collections.abc import Sequence

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import counted
from sidegan.base.settings_text import FILL_IN, setting_name, suggest_fields, suggestion
from sidegan.errors import RecordingError
from sidegan.recording import thresholds
from sidegan.recording.agreement import Agreement
from sidegan.recording.clock import stamp_text
from sidegan.recording.recording import Recording
from sidegan.recording.statistics import Signal, Statistics
from sidegan.recording.units import SECONDS, Units
from sidegan.robot import Arm

DEGREES, MILLIMETRES = 180 / math.pi, 1e3
_THOUSANDTH = {"torque": "mNm", "current": "mA"}


def doubt_of_units(statistics: Statistics, arm: Arm, units: Units) -> str | None:
    """Message if positions make sense only in another unit; time stamps that do are refused."""
    name = statistics.name
    position = statistics.signals["position"]
    if statistics.step > thresholds.LONGEST_STEP and 2 * statistics.duplicates > statistics.samples:
        rate = float(f"{statistics.samples / (statistics.duration + statistics.step):.3g}")
        exact = suggest_fields("recording", {"time": "none", "rate": rate})
        raise RecordingError(
            f"{name}: time stamps have a resolution of {statistics.step:.3g} s, {statistics.duplicates} of "
            f"{statistics.samples} repeat the one before: log finer stamps, or, if samples are regular, "
            f"give their exact rate instead: {exact}"
        )
    if statistics.step > thresholds.LONGEST_STEP:
        raw = statistics.step / SECONDS[units.time or "s"]
        likely = next((unit for unit in ("ms", "us") if raw * SECONDS[unit] <= thresholds.USUAL_STEP), "ns")
        raise RecordingError(
            f"{name}: samples are {statistics.step:.3g} s apart: are the time stamps in another unit? "
            f"({suggestion('recording.units.time', likely)})"
        )
    return _angles(position, arm, units) or _lengths(position, arm, units) or _counts(position, arm, units)


def _angles(position: Signal, arm: Arm, units: Units) -> str | None:
    """Message if angles look like degrees taken for radians, or vice versa."""
    turning = ~arm.prismatic
    reach = position.largest
    limit = _limit(arm)
    far = turning & (reach > thresholds.FAR_ANGLE * limit) & (reach > thresholds.ANY_ANGLE)
    most = np.maximum(limit, thresholds.ANY_ANGLE)[turning]
    if units.angle in (None, "rad") and far.any() and (reach[turning] / DEGREES <= most).all():
        if units.position is not None:
            return f"{_reaches(position, arm, far)}: is recording.units.position right?"
        degrees = suggestion("recording.units.angle", "deg")
        motors = suggestion("recording.units.position", {"per_turn": [FILL_IN]})
        return (
            f"{_reaches(position, arm, far)}: are these degrees? ({degrees}) or of the motors, before their "
            f"gears? ({motors}, 2π times each joint's ratio)"
        )
    span = (position.upper - position.lower)[turning]
    slow = 0 < span.max(initial=0.0) < thresholds.LEAST_ANGLE
    if units.angle == "deg" and units.position is None and slow:
        turned = f"{span.max() * DEGREES:.3g}°"
        radians = suggestion("recording.units.angle", "rad")
        return f"no joint turns more than {turned}: are these radians? ({radians})"
    return None


def _lengths(position: Signal, arm: Arm, units: Units) -> str | None:
    """Message if lengths look like millimetres taken for metres, or vice versa."""
    sliding = arm.prismatic
    reach = position.largest
    limit = _limit(arm)
    far = sliding & (reach > thresholds.FAR_LENGTH * limit)
    as_millimetres = MILLIMETRES * limit * thresholds.FAR_ANGLE
    if units.position is not None:
        return None
    if units.length in (None, "m") and far.any() and (reach[far] <= as_millimetres[far]).all():
        millimetres = suggestion("recording.units.length", "mm")
        return f"{_reaches(position, arm, far)}: are these millimetres? ({millimetres})"
    span, whole = position.upper - position.lower, arm.position_upper - arm.position_lower
    used = MILLIMETRES * span > thresholds.USED_LENGTH * whole
    short = sliding & used & (MILLIMETRES * reach <= thresholds.FAR_ANGLE * limit)
    if units.length == "mm" and short.any():
        slid = f"{arm.named(short)} slides no more than {span[short].max() * MILLIMETRES:.3g} mm"
        return f"{slid}: are these metres? ({suggestion('recording.units.length', 'm')})"
    return None


def _counts(position: Signal, arm: Arm, units: Units) -> str | None:
    """Message if positions look like encoder counts."""
    if units.position is not None:
        return None
    far = position.largest > thresholds.FAR_COUNTS * _limit(arm)
    if 2 * far.sum() <= arm.joints:
        return None
    largest = float(position.upper.max()) * (DEGREES if units.angle == "deg" else 1.0)
    per_turn = 2 ** math.ceil(math.log2(max(largest, 2)))
    zero = per_turn // 2 if (position.lower >= 0).all() else 0
    return (
        f"{_reaches(position, arm, far)}, which no unit explains: are these encoder counts? If so, give the "
        "counts per turn and the reading at joint position zero, for example "
        f"{suggestion('recording.units.position', {'per_turn': per_turn, 'zero': zero})}"
    )


def _limit(arm: Arm) -> Array:
    """Largest absolute joint positions within limits [rad or m], (J,)."""
    return np.maximum(np.abs(arm.position_lower), np.abs(arm.position_upper))


def _reaches(position: Signal, arm: Arm, far: Array) -> str:
    """Text on how far the first of the marked joints reaches, and its limit."""
    j = int(far.argmax())
    unit = "m" if arm.prismatic[j] else "rad"
    reach, limit = position.largest[j], _limit(arm)[j]
    return f"{arm.joint_names[j]} reaches {reach:.4g} {unit}, its limit is {limit:.4g} {unit}"


def refuse_idle(statistics: Statistics, arm: Arm, without: Sequence[str]) -> None:
    """Refuse a recording without motion or torque, or with constant rates of moving joints.

    ``without`` are the joints that ``recording.without`` has already, to which messages add others.
    """
    file, signals = statistics.name, statistics.signals
    span = signals["position"].upper - signals["position"].lower
    if (span < thresholds.MOVED).all():
        raise RecordingError(
            f"{file} hardly moves: no joint by more than {span.max():.2g} rad or m; identification needs "
            "motions through a good part of the arm's range, such as excite designs"
        )
    name = statistics.load
    signal = signals[name]
    if not signal.largest.max() > 0:
        raise RecordingError(f"{file}: every {name} is zero")
    if signal.constant.any():
        raise RecordingError(
            f"{file}: the {name} of {arm.named(signal.constant)} is blank or constant over the whole "
            f"recording; {without_torque(arm, signal.constant, span >= thresholds.MOVED, without)}"
        )
    for rate in [name for name in ("velocity", "acceleration") if name in signals]:
        dead = signals[rate].constant & (span >= thresholds.MOVED)
        if dead.any():
            raise RecordingError(
                f"{file}: the {rate} of {arm.named(dead)} is constant while it moves; "
                f"{suggestion(f'recording.{rate}', None)} derives it instead"
            )


def without_torque(arm: Arm, lacking: Array, moving: Array, without: Sequence[str]) -> str:
    """How to identify an arm without the torques of some joints, of which some move, (J,) marked each."""
    joints = arm.named(lacking)
    names = [arm.joint_names[j] for j in np.flatnonzero(lacking)]
    still = suggestion("recording.without", [*without, *names])
    first = int(lacking.argmax())
    if not (lacking & moving).any():
        return f"a joint that never moves can be left out: {still}"
    advice = f"record with {joints} at rest, which {still} then locks there"
    if lacking[first:].all() and first:
        link = arm.link_names[first - 1]
        tip = suggestion("robot.tip", link)
        advice += f"; or identify the joints before, with what {joints} moves as a part of {link}: {tip}"
    return advice


def refuse_jumps(recording: Recording, arm: Arm, gap: float) -> None:
    """Refuse positions that jump and stay, without a gap [s] in the time stamps.

    A jump exceeds many times both the usual large steps and the joint's speed. Wrong samples jump back.
    """
    time = recording.time
    steps = np.diff(time)
    for j, name in enumerate(arm.joint_names):
        q = recording.position[:, j]
        moved = np.abs(np.diff(q))
        usual = np.maximum(np.quantile(moved, thresholds.JUMP_QUANTILE), arm.velocity_limit[j] * steps)
        far = moved > np.maximum(thresholds.JUMP, thresholds.JUMP_STEPS * usual)
        for k in np.flatnonzero(far & (steps <= gap)).tolist():
            before = np.median(q[max(k - thresholds.JUMP_SAMPLES, 0) : k + 1])
            after = np.median(q[k + 1 : k + 2 + thresholds.JUMP_SAMPLES])
            if abs(after - before) > moved[k] / 2:
                unit = "m" if arm.prismatic[j] else "rad"
                raise RecordingError(
                    f"{recording.name}: {name} jumps by {moved[k]:.2g} {unit} after sample {k + 1}, at "
                    f"{stamp_text(time[k])}: are rows missing, or was its encoder reset? split the file there"
                )


def refuse_overload(
    statistics: Statistics,
    arm: Arm,
    agreement: Agreement,
    units: Units,
    torques: Sequence[tuple[Array, Array]],
) -> None:
    """Refuse torques far beyond the arm's limits, or without limits far beyond the described torques.

    Limits below the described torques of the same motion are ignored. ``torques`` are times (S,) [s] and
    torques (S, J) [N·m or N] before filtering, which show whether a few samples are the cause.
    """
    limited = np.isfinite(arm.torque_limit).any() and (agreement.needed <= arm.torque_limit).all()
    share, most, than = agreement.usual / arm.torque_limit, thresholds.BEYOND_TORQUE_LIMIT, "its limit"
    if not limited:
        share = np.full_like(agreement.usual, agreement.heavier)
        most, than = thresholds.BEYOND_DESCRIPTION, "what the description predicts"
    if not (share > most).any():
        return
    j = int(share.argmax())
    unit = "N" if arm.prismatic[j] else "N·m"
    time, raw = (np.concatenate(x) for x in zip(*torques))
    size = np.abs(raw[:, j])
    beyond = np.flatnonzero(size > agreement.usual[j])
    if len(beyond) < thresholds.OUTLIERS * len(size):
        worst = int(size.argmax())
        raise RecordingError(
            f"{statistics.name}: the torque of {arm.joint_names[j]} is {raw[worst, j]:.4g} {unit} at "
            f"{stamp_text(time[worst])}, and beyond {agreement.usual[j]:.4g} {unit} in only "
            f"{counted(len(beyond), 'sample')} of {len(size)}: remove these rows from the file"
        )
    measured = statistics.load
    smaller = _THOUSANDTH[measured]
    if thresholds.BEYOND_DESCRIPTION < share[j] <= 1e3 * most and getattr(units, measured) != smaller:
        suspicion = f"is the {measured} in {smaller}? ({suggestion(f'recording.units.{measured}', smaller)})"
    elif measured == "current":
        suspicion = f"are the drive gains ({setting_name('robot.gains')}) and the joint order right?"
    else:
        suspicion = f"is it in {unit}, and the joint order right? (a current is named by recording.current)"
    joints = zip(arm.joint_names, agreement.usual.tolist(), (share > most).tolist())
    raised = suggestion("robot.limits.effort", {name: math.ceil(usual) for name, usual, far in joints if far})
    raise RecordingError(
        f"{statistics.name}: the torque of {arm.joint_names[j]} reaches {agreement.usual[j]:.4g} {unit}, "
        f"{share[j]:.3g} times {than}: {suspicion}; if the arm can do that, raise its limits: {raised}"
    )
