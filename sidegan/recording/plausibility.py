"""Doubts about a raw recording: clock, ranges, saturation, signals that do not change."""

import numpy as np

from sidegan.base.names import counted
from sidegan.recording.statistics import Statistics
from sidegan.robot import Arm

_MOST_JITTER = 0.5
_COARSE = 0.02  # of a joint's torque range, that a quantum of it is noticed at
_NOTHING = 1e-12
_LITTLE = 0.1  # of its range, that a joint moves through at least where much can be told
_OUTSIDE = 1e-3  # [rad or m] beyond a limit that is noticed


def clock_warnings(statistics: Statistics) -> list[str]:
    """Oddities of the time stamps and the rows."""
    gaps, corrupt, warnings = statistics.gaps, statistics.corrupt, []
    if gaps:
        start, longest = max(gaps, key=lambda gap: gap[1])
        where = f"the longest {longest:.3g} s after {start:.6g} s"
        warnings.append(f"{counted(len(gaps), 'gap')}, {where}; not crossed")
    if found := statistics.bridged:
        warnings.append(f"{counted(found, 'gap')} of up to {statistics.gap * 1e3:.3g} ms, interpolated over")
    if found := statistics.duplicates:
        warnings.append(f"{counted(found, 'sample')} with the time stamp of the one before, left out")
    if statistics.jitter > _MOST_JITTER:
        warnings.append(f"the time between samples varies by {statistics.jitter:.0%}")
    if corrupt:
        first = "row {}: {}".format(*corrupt[0])
        warnings.append(f"{counted(len(corrupt), 'corrupt row')}, left out; the first is {first}")
    return warnings


def range_warnings(statistics: Statistics, arm: Arm) -> list[str]:
    """Oddities of the signals' ranges."""
    signals, position = statistics.signals, statistics.signals["position"]
    lower, upper, span = arm.position_lower, arm.position_upper, position.upper - position.lower
    outside = (position.lower < lower - _OUTSIDE) | (position.upper > upper + _OUTSIDE)
    little = span / np.maximum(upper - lower, _NOTHING) < _LITTLE
    name, load = statistics.load, signals[statistics.load]
    coarse = load.quantum > _COARSE * (load.upper - load.lower)
    hardly = f"no joint by more than {span.max():.2g} rad or m, a tenth of its range"
    found = [
        (position.constant, "{} never moved"),
        (little.all(), f"the arm hardly moves: {hardly}"),
        (outside, "{} left the limits of position"),
        (load.clipped > 0, f"the {name} of {{}} looks saturated at an extreme"),
        (coarse, f"the {name} of {{}} is coarsely quantised"),
    ]
    if name == "torque":
        found.append((load.largest > arm.torque_limit, "the torque of {} is beyond the arm's limit"))
    warnings = [text.format(arm.named(which)) if which.ndim else text for which, text in found if which.any()]
    for joint, begin, end in statistics.frozen:
        warnings.append(
            f"the {name} of {arm.joint_names[joint]} stays the same from {begin:.2f} s to {end:.2f} s, "
            "though it moves: take these rows out of the file"
        )
    return warnings
