"""The clock of a recording: its time stamps, gaps, and stamps that run backwards."""

from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array
from sidegan.errors import RecordingError
from sidegan.recording import thresholds

_LEADING = 0.0999999  # fraction of a second below which it has a leading zero


@dataclass(frozen=True, kw_only=True)
class Clock:
    """Time stamps of a recording."""

    duration: float  # from first to last sample [s]
    step: float  # mean time between samples, without gaps [s]
    jitter: float  # standard deviation of that time, relative to its mean
    duplicates: int  # rows with the previous row's time stamp
    gaps: tuple[tuple[float, float], ...]  # start and length of each gap [s]
    gap: float  # time between samples above which it is a gap [s]
    bridged: int = 0  # shorter breaks, over five steps long, that are interpolated over


def clock_of(name: str, time: Array, gap: float | None = None) -> Clock:
    """Clock of time stamps [s], (S,); ``name`` is for messages."""
    steps = np.diff(time)
    if (steps < 0).any():
        _refuse_unpadded(name, time)
        row = int(np.argmax(steps < 0))
        # after a restart, the rows that follow are in order, and all of them early
        follow = time[row + 1 : row + 1 + thresholds.LEAST_SAMPLES]
        later = (np.diff(follow) >= 0).all() and (follow < time[row]).all()
        restarts = later and (steps < 0).mean() < thresholds.RESTARTS
        remedy = "the clock restarts, so split the file there" if restarts else "sort its rows by time"
        raise RecordingError(
            f"{name}: time runs backwards, from {stamp_text(time[row])} to "
            f"{stamp_text(time[row + 1])}, after sample {row + 1}: {remedy}"
        )
    forward = steps[steps > 0]
    if not len(forward):
        raise RecordingError(f"{name}: all samples have the same time stamp, {stamp_text(time[0])}")
    limit = gap or thresholds.GAP_STEPS * float(np.median(forward))
    regular = forward[forward <= limit]
    if not len(regular):
        raise RecordingError(f"{name}: all samples are further apart than the longest gap, {limit:g} s")
    step = float(regular.mean())
    return Clock(
        duration=float(time[-1] - time[0]),
        step=step,
        jitter=float(regular.std()) / step,
        duplicates=int((steps == 0).sum()),
        gaps=tuple((float(time[i]), float(steps[i])) for i in np.flatnonzero(steps > limit)),
        gap=limit,
    )


def stamp_text(time: float) -> str:
    """A time stamp [s] for people, to microseconds: those since 1970 have ten digits before the point."""
    return f"{round(time, 6) + 0.0:.6f}".rstrip("0").rstrip(".") + " s"


def _refuse_unpadded(name: str, time: Array) -> None:
    """Refuse stamps (S,) whose fractions lack leading zeros: .8, .9 and then .10, within the same second."""
    whole = np.floor(time)
    back = np.flatnonzero(np.diff(time) < 0)
    part = time - whole
    unpadded = (part == 0) | (part > _LEADING)
    more_digits = part[back + 1] < 2 * _LEADING  # most begin with 1: 100 follows 99
    if len(back) > 1 and (np.diff(whole) >= 0).all() and unpadded.all() and 2 * more_digits.sum() > len(back):
        k = int(back[0])
        raise RecordingError(
            f"{name}: {time[k]:.12g} s comes before {time[k + 1]:.12g} s, and so on {len(back)} times: were "
            "nanoseconds put behind the point of seconds without their leading zeros? write them in a column "
            "of their own, or with nine digits"
        )
