"""Merging of a recording's signals from several files with a common clock."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.errors import RecordingError
from sidegan.recording.clock import clock_of, stamp_text
from sidegan.recording.grid import interpolate


class ClockedSignals(NamedTuple):
    """Signals of a file, without corrupt rows."""

    file: str
    stamped: bool  # whether the file has time stamps; otherwise they follow from row numbers and rate
    time: Array  # stamps [s], (S,)
    signals: dict[str, Array]  # the others in SI units, (S, J)
    corrupt: list[tuple[int, str]]  # row numbers and reasons of corrupt rows
    remarks: list[str]  # on the columns


def merge(parts: Sequence[ClockedSignals]) -> ClockedSignals:
    """Signals at the stamps of the fastest file, with the corrupt rows of all files.

    Only times that all files cover are kept, without interpolation over gaps. A single file is unchanged.
    """
    first = parts[0]
    if len(parts) == 1:
        return first
    without = [part.file for part in parts if not part.stamped]
    stamped = [part.file for part in parts if part.stamped]
    if without and stamped:
        raise RecordingError(
            f"{stamped[0]} has time stamps, but {without[0]} has none: add a column of time stamps to "
            f"{without[0]}"
        )
    corrupt = [(row, f"{part.file}: {reason}") for part in parts for row, reason in part.corrupt]
    remarks = [f"{part.file}: {remark}" for part in parts for remark in part.remarks]
    if all(np.array_equal(part.time, first.time) for part in parts):
        signals = {name: x for part in parts for name, x in part.signals.items()}
        return first._replace(signals=signals, corrupt=corrupt, remarks=remarks)
    clocks = [clock_of(part.file, part.time) for part in parts]
    fastest = parts[int(np.argmin([clock.step for clock in clocks]))]
    begin = max(part.time[0] for part in parts)
    end = min(part.time[-1] for part in parts)
    if not begin < end:
        spans = [f"{x.file} from {stamp_text(x.time[0])} to {stamp_text(x.time[-1])}" for x in parts]
        raise RecordingError(
            f"the files do not overlap in time, expected time stamps of one clock: {'; '.join(spans)}"
        )
    time = np.unique(fastest.time[(fastest.time >= begin) & (fastest.time <= end)])
    signals = {
        name: interpolate(time, part.time, x, clock.gap)
        for part, clock in zip(parts, clocks)
        for name, x in part.signals.items()
    }
    whole = np.isfinite(np.concatenate([*signals.values()], 1)).all(1)
    if not whole.any():
        raise RecordingError(f"{listed([part.file for part in parts])} have no time in common but in gaps")
    others = [part.file for part in parts if not np.isin(time[whole], part.time).all()]
    remarks += [f"{listed(others)}: interpolated at the time stamps of {fastest.file}"] if others else []
    lost = max(max(begin - part.time[0], part.time[-1] - end) for part in parts)
    if lost > max(clock.step for clock in clocks):
        remarks.append(f"only {stamp_text(begin)} to {stamp_text(end)} is in all files; the rest is left out")
    signals = {name: x[whole] for name, x in signals.items()}
    return ClockedSignals(first.file, first.stamped, time[whole], signals, corrupt, remarks)
