"""What in a raw recording is hardly true: units, clock, ranges, saturation, signals that do not change."""

import math

import torch
from torch import Tensor

from sidegan.errors import RecordingError
from sidegan.recording.raw import Survey
from sidegan.robot import Arm

_DEGREES = 180 / math.pi
_FAR = 1.5  # times a joint limit, beyond which positions are hardly in radians
_TURN = 2.1 * math.pi  # [rad] that nothing moves from zero without a reason
_TINY = 2 * math.pi / _DEGREES  # [rad] that a turn becomes when radians are taken for degrees
_SLOWEST = 0.5  # [s] between samples, with which no arm's motion is recorded
_MOST_JITTER = 0.5
_COARSE = 0.02  # of a joint's torque range, that a quantum of it is noticed at


def refuse_wrong_units(known: Survey, arm: Arm, angle: str) -> None:
    """Refuse positions and time stamps that make sense in another unit only.

    Raises:
        RecordingError: naming the joint and the value.
    """
    if known.step > _SLOWEST:
        raise RecordingError(
            f"{known.name}: samples are {known.step:.3g} s apart: are the time stamps in another unit? "
            "(recording.units.time=ms)"
        )
    position, turning = known.signals["position"], ~arm.prismatic
    reach = torch.maximum(position.lower.abs(), position.upper.abs())
    limit = torch.maximum(arm.position_lower.abs(), arm.position_upper.abs())
    far = turning & (reach > _FAR * limit) & (reach > _TURN)
    if angle == "rad" and far.any() and (reach[turning] / _DEGREES <= limit[turning]).all():
        j = int(far.nonzero()[0])
        raise RecordingError(
            f"{known.name}: {arm.joint_names[j]} reaches {reach[j]:.4g} rad, its limit is {limit[j]:.4g} "
            "rad: are these degrees? (recording.units.angle=deg)"
        )
    span = (position.upper - position.lower)[turning]
    if angle == "deg" and len(span) and 0 < span.max() < _TINY:
        raise RecordingError(
            f"{known.name}: no joint turns by more than {span.max() * _DEGREES:.3g}°: are these radians? "
            "(recording.units.angle=rad)"
        )


def refuse_idle(known: Survey) -> None:
    """Refuse a recording without motion or torque.

    Raises:
        RecordingError: saying what does not change.
    """
    position = known.signals["position"]
    if not (position.upper > position.lower).any():
        raise RecordingError(f"{known.name}: all positions are constant: there is no motion")
    name = "torque" if "torque" in known.signals else "current"
    signal = known.signals.get(name)
    if signal is None:
        raise RecordingError(f"{known.name} has neither torque nor current")
    if not (signal.lower.abs() + signal.upper.abs()).max() > 0:
        raise RecordingError(f"{known.name}: every {name} is zero")
    dead = signal.upper == signal.lower
    if dead.any():
        joints = ", ".join(str(int(j) + 1) for j in dead.nonzero()[:, 0])
        raise RecordingError(
            f"{known.name}: the {name} of joint {joints} is constant over the whole recording"
        )


def clock_warnings(known: Survey) -> list[str]:
    """What is odd about the time stamps and the rows."""
    found = []
    if known.gaps:
        start, longest = max(known.gaps, key=lambda gap: gap[1])
        found.append(
            f"{len(known.gaps)} gaps, the longest {longest:.3g} s after {start:.6g} s; they are not crossed"
        )
    if known.duplicates:
        found.append(f"{known.duplicates} samples have the time stamp of the one before; they are left out")
    if known.jitter > _MOST_JITTER:
        found.append(f"the time between samples varies by {known.jitter:.0%}")
    if known.corrupt:
        row, reason = known.corrupt[0]
        found.append(f"{len(known.corrupt)} corrupt rows are left out; the first is row {row}: {reason}")
    return found


def range_warnings(known: Survey, arm: Arm) -> list[str]:
    """What is odd about the ranges of the signals.

    Raises:
        RecordingError: when a velocity or acceleration is constant while its joint moves.
    """
    found = []
    position = known.signals["position"]
    names = arm.joint_names
    still = [n for n, low, high in zip(names, position.lower, position.upper) if low == high]
    if still:
        found.append(f"{', '.join(still)} never moves")
    outside = (position.lower < arm.position_lower - 1e-3) | (position.upper > arm.position_upper + 1e-3)
    if outside.any():
        found.append(f"{_named(names, outside)} leaves its limits of position")
    for name in ("velocity", "acceleration"):
        if name in known.signals:
            signal = known.signals[name]
            dead = (signal.lower == signal.upper) & (position.lower < position.upper)
            if dead.any():
                raise RecordingError(
                    f"{known.name}: the {name} of {_named(names, dead)} is constant while it moves"
                )
    for name in ("torque", "current"):
        if name in known.signals:
            signal = known.signals[name]
            if (signal.clipped > 0).any():
                found.append(
                    f"the {name} of {_named(names, signal.clipped > 0)} looks saturated at an extreme"
                )
            coarse = signal.quantum > _COARSE * (signal.upper - signal.lower)
            if coarse.any():
                found.append(f"the {name} of {_named(names, coarse)} is coarsely quantised")
    if "torque" in known.signals:
        torque = known.signals["torque"]
        most = torch.maximum(torque.lower.abs(), torque.upper.abs())
        if (most > arm.torque_limit).any():
            found.append(f"the torque of {_named(names, most > arm.torque_limit)} is beyond the arm's limit")
    return found


def _named(names: tuple[str, ...], which: Tensor) -> str:
    return ", ".join(name for name, is_it in zip(names, which.tolist()) if is_it)
