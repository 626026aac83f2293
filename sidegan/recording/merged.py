"""Signals of one recording that lie in files of their own, on one clock."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sidegan.base.names import listed
from sidegan.errors import RecordingError
from sidegan.recording.grid import interpolated
from sidegan.recording.statistics import clock_of
from sidegan.recording.tables import Numbers


@dataclass(frozen=True)
class Track:
    """A signal as its file has it."""

    file: str
    signal: str
    time: Numbers  # [s], (S,)
    values: Numbers  # in SI units, (S, J)
    stamped: bool  # whether the file has time stamps; else they are numbers of rows over a rate


def merged(tracks: Sequence[Track]) -> tuple[Numbers, dict[str, Numbers], list[str]]:
    """Time (S,) and signals (S, J) at the stamps of the fastest file, and what a person should know of them.

    Only what all files cover counts, and in none of them is interpolated over a gap.

    Raises:
        RecordingError: when time runs backwards in a file, one is without a clock, or they have no time in
            common.
    """
    _refuse_unstamped(tracks)
    first = tracks[0]
    if all(np.array_equal(one.time, first.time) for one in tracks):
        return first.time, {one.signal: one.values for one in tracks}, []
    clocks = [clock_of(one.file, one.time) for one in tracks]
    steps = [clock.step for clock in clocks]
    fastest = tracks[int(np.argmin(steps))]
    begin, end = max(one.time[0] for one in tracks), min(one.time[-1] for one in tracks)
    if not begin < end:
        spans = "; ".join(f"{one.file} from {one.time[0]:.6g} s to {one.time[-1]:.6g} s" for one in tracks)
        raise RecordingError(f"no moment is in all files, expected time stamps of one clock: {spans}")
    time = np.unique(fastest.time[(fastest.time >= begin) & (fastest.time <= end)])
    signals = {
        one.signal: interpolated(time, one.time, one.values, clock.gap) for one, clock in zip(tracks, clocks)
    }
    whole = np.isfinite(np.concatenate([*signals.values()], 1)).all(1)
    others = [one.file for one in tracks if not np.isin(time[whole], one.time).all()]
    remarks = [f"{listed(others)}: interpolated at the time stamps of {fastest.file}"] if others else []
    lost = max(max(begin - one.time[0], one.time[-1] - end) for one in tracks)
    if lost > max(steps):
        remarks.append(f"only {begin:.6g} s to {end:.6g} s is in all files; the rest of them is left out")
    return time[whole], {name: x[whole] for name, x in signals.items()}, remarks


def _refuse_unstamped(tracks: Sequence[Track]) -> None:
    """Raise when some files have time stamps and others have none."""
    without = [one.file for one in tracks if not one.stamped]
    stamped = [one.file for one in tracks if one.stamped]
    if without and stamped:
        raise RecordingError(
            f"{without[0]} has no column of time stamps, and {stamped[0]} has one: write the time stamps of "
            f"its rows into {without[0]}, too"
        )
