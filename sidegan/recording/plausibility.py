"""Warnings about a recording: clock, ranges, saturation, frozen or contradictory signals."""

import math
from itertools import combinations

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import counted
from sidegan.errors import RecordingError
from sidegan.recording import thresholds
from sidegan.recording.clock import stamp_text
from sidegan.recording.recording import Recording, Segment
from sidegan.recording.refusals import DEGREES
from sidegan.recording.statistics import Statistics
from sidegan.recording.thresholds import NEGLIGIBLE
from sidegan.robot import Arm

RATES = {"velocity": "position", "acceleration": "velocity"}  # a rate, and what it is the derivative of


def clock_warnings(statistics: Statistics) -> list[str]:
    """Warnings about time stamps and rows."""
    corrupt = statistics.corrupt
    warnings = []
    if gaps := statistics.gaps:
        start, longest = max(gaps, key=lambda gap: gap[1])
        where = f"the longest {longest:.3g} s after {stamp_text(start)}"
        warnings.append(f"{counted(len(gaps), 'gap')}, {where}; not bridged")
    if found := statistics.bridged:
        warnings.append(f"{counted(found, 'gap')} of up to {statistics.gap * 1e3:.3g} ms, interpolated")
    if found := statistics.duplicates:
        warnings.append(f"{counted(found, 'sample')} with a repeated time stamp, left out")
    if statistics.jitter > thresholds.MOST_JITTER:
        warnings.append(f"the time between samples varies by {statistics.jitter:.0%}")
    if corrupt:
        first = "row {}: {}".format(*corrupt[0])
        warnings.append(f"{counted(len(corrupt), 'corrupt row')}, left out; the first is {first}")
    return warnings


def range_warnings(statistics: Statistics, arm: Arm) -> list[str]:
    """Warnings about the ranges of signals."""
    position = statistics.signals["position"]
    span = position.upper - position.lower
    lower, upper = arm.position_lower, arm.position_upper
    slack = thresholds.BEYOND_LIMITS
    outside = (position.lower < lower - slack) | (position.upper > upper + slack)
    little = span / np.maximum(upper - lower, NEGLIGIBLE) < thresholds.HARDLY_MOVED
    name = statistics.load
    load = statistics.signals[name]
    coarse = load.quantum > thresholds.COARSE_TORQUE * (load.upper - load.lower)
    hardly = f"no joint by more than {span.max():.2g} rad or m, or a tenth of its range"
    found = [
        (position.constant, "{} never moved"),
        (little.all(), f"the arm hardly moves: {hardly}"),
        (outside, "{} exceeded the position limits"),
        (coarse, f"the {name} of {{}} is coarsely quantised"),
    ]
    if name == "torque":
        found.append((load.largest > arm.torque_limit, "the torque of {} exceeds the arm's limit"))
    warnings = [text.format(arm.named(which)) if which.ndim else text for which, text in found if which.any()]
    return warnings


def fault_warnings(statistics: Statistics, arm: Arm) -> list[str]:
    """Warnings about torques or currents that cannot be those of the motion."""
    name = statistics.load
    clipped = statistics.signals[name].clipped > 0
    warnings = [f"the {name} of {arm.named(clipped)} looks saturated"] if clipped.any() else []
    for joint, begin, end in statistics.frozen:
        warnings.append(
            f"the {name} of {arm.joint_names[joint]} is frozen from {stamp_text(begin)} to "
            f"{stamp_text(end)}, although the joint moves: remove these rows from the file"
        )
    return warnings


def twice_warnings(recording: Recording) -> list[str]:
    """Warnings about joints that move but have the same positions, torques or currents in every sample."""
    found = []
    for name in ("position", recording.load):
        x = recording.signals()[name]
        for j, k in combinations(np.flatnonzero(np.ptp(x, 0) > thresholds.MOVED).tolist(), 2):
            if np.array_equal(x[:, j], x[:, k]):
                joints = " and ".join(recording.joint_names[i] for i in (j, k))
                found.append(
                    f"the {name}s of {joints} are the same column: was one written twice? "
                    f"(recording.{name} names the columns)"
                )
    return found


def contradiction(file: str, arm: Arm, rate: str, segments: list[Segment]) -> str | None:
    """Warning about a recorded rate that is not the derivative of its signal; None if it is.

    Noise only lowers the slope, of the rate over the derivative or its inverse, so high slopes are errors.
    """
    derivatives = [_derivative(segment, getattr(segment, RATES[rate])) for segment in segments]
    derived = np.concatenate([x[1:-1] for x in derivatives])
    recorded = np.concatenate([getattr(segment, rate)[1:-1] for segment in segments])
    products = derived.T @ recorded  # (J, J): derived, recorded
    own = np.square(derived).sum(0)
    other = np.square(recorded).sum(0)
    moving = np.sqrt(np.maximum(own, other) / len(derived)) > thresholds.LEAST_RATE
    slope = products.diagonal() / np.maximum(own, NEGLIGIBLE)
    inverse = products.diagonal() / np.maximum(other, NEGLIGIBLE)
    correlation = products / np.maximum(np.sqrt(own[:, None] * other), NEGLIGIBLE)
    alike = correlation.diagonal()
    for j in np.flatnonzero(moving & ~arm.prismatic).tolist():
        ratio = abs(slope[j])
        off = abs(abs(math.log(max(ratio, NEGLIGIBLE))) - math.log(DEGREES))
        if off < thresholds.DEGREES_RATIO and abs(alike[j]) > thresholds.RATE_CORRELATION:
            raise RecordingError(
                f"{file}: the {rate} of {arm.joint_names[j]} is {ratio:.3g} times the derivative of its "
                f"{RATES[rate]}: one is in degrees and the other in radians"
            )
    steep = np.maximum(slope, inverse) > thresholds.RATE_RATIO
    wrong = moving & (steep | (alike < thresholds.RATE_CORRELATION))
    if not wrong.any():
        return _late(rate, derivatives, segments)
    ratios = []
    for j in np.flatnonzero(wrong).tolist():
        k = int(correlation[:, j].argmax())
        swapped = k != j and correlation[k, j] > thresholds.OTHER_RATE
        others = f": it is that of {arm.joint_names[k]}" if swapped else ""
        ratios.append(f"{slope[j]:.2f} ({arm.joint_names[j]}{others})")
    return (
        f"the {rate} is {', '.join(ratios)} times the derivative of the {RATES[rate]}, so it is derived "
        f"instead: were columns swapped, scaled or reversed? (recording.{rate}=null silences this)"
    )


def _derivative(segment: Segment, x: Array) -> Array:
    """Time derivative of a segment's signal, (S, J)."""
    return np.asarray(np.gradient(x, segment.time[1] - segment.time[0], axis=0))


def _late(rate: str, derivatives: list[Array], segments: list[Segment]) -> str | None:
    """Warning about a rate that is later or earlier than the derivative of its signal; None if it is not.

    To first order, r(t) = ṡ(t − L) is ṡ − L s̈.
    """
    moved = changed = 0.0
    for derived, segment in zip(derivatives, segments):
        further = _derivative(segment, derived)
        moved += float(((derived - getattr(segment, rate)) * further).sum())
        changed += float(np.square(further).sum())
    lag = moved / max(changed, NEGLIGIBLE)
    if abs(lag) < thresholds.RATE_LAG:
        return None
    when = "later" if lag > 0 else "earlier"
    return (
        f"the {rate} is {1e3 * abs(lag):.2g} ms {when} than the derivative of the {RATES[rate]}, so it is "
        f"derived instead (recording.{rate}=null silences this)"
    )
