"""Samples that two recordings share, whatever the files' names and the place of the samples in them."""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
import pandas as pd

from sidegan.base.arrays import Array
from sidegan.errors import RecordingError
from sidegan.recording.grid import stretches
from sidegan.recording.recording import Recording

_STRETCH = 32  # consecutive common rows that are no coincidence
_COUNTED = ("torque", "current", "velocity", "acceleration")  # compared if both recordings have them


class Digests(NamedTuple):
    """Hashes of a recording's rows, to find recordings with the same rows."""

    time: Array  # of the rows [s], (S,)
    signals: dict[str, Array]  # hashes by name of the signal, (S,) each
    load: str  # torque or current, from which the arm is identified

    def changing(self, names: Sequence[str]) -> tuple[Array, Array]:
        """Combined hashes of signals, and times, of rows in which the first signal changes, (K,) each."""
        first = self.signals[names[0]]
        keep = np.append(True, first[1:] != first[:-1])
        return _hashes(np.stack([self.signals[name] for name in names], 1))[keep], self.time[keep]


def digests_of(recording: Recording) -> Digests:
    """Digests of a recording's rows in single precision, which some files use."""
    single = {name: x.astype(np.float32) + np.float32(0) for name, x in recording.signals().items()}
    signals = {name: _hashes(x) for name, x in single.items()}
    return Digests(recording.time, signals, recording.load)


def refuse_shared(recordings: Sequence[tuple[str, Digests]]) -> None:
    """Refuse named recordings if any two of them share a stretch of samples or torques."""
    for (first, a), (second, b) in combinations(recordings, 2):
        common = ["position", *(n for n in _COUNTED if n in a.signals and n in b.signals)]
        (hashes, _), (others, time) = (x.changing(common) for x in (a, b))
        if where := _stretch(np.isin(others, hashes), time):
            raise RecordingError(
                f"{second} holds samples of {first}, {where}: they would count twice, "
                "or a model would be validated on its own training data"
            )
        (hashes, _), (others, time) = (x.changing([x.load]) for x in (a, b))
        if where := _stretch(_in_order(hashes, others), time):
            raise RecordingError(
                f"{second} has the same torques as {first}, {where}, but another motion: "
                "one of the two has the torques of another recording"
            )


def _stretch(common: Array, time: Array) -> str:
    """Start and end of the longest stretch of common rows, as text; empty if it may be a coincidence."""
    begins, ends = stretches(common)
    if not (ends - begins >= _STRETCH).any():
        return ""
    longest = int(np.argmax(ends - begins))
    begin, end = time[[begins[longest], ends[longest] - 1]]
    return f"from {begin:.6g} s to {end:.6g} s"


def _in_order(hashes: Array, others: Array) -> Array:
    """Which of the other rows occur in the same order; coarse currents repeat by coincidence."""
    order = np.argsort(hashes, kind="stable")
    place = order[np.searchsorted(hashes, others, sorter=order).clip(max=len(hashes) - 1)]
    same = hashes[place] == others
    next_ = same[1:] & same[:-1] & (place[1:] == place[:-1] + 1)
    return np.append(False, next_) | np.append(next_, False)


def _hashes(rows: Array) -> Array:
    """A hash of each row (S, C), (S,)."""
    return np.asarray(pd.util.hash_pandas_object(pd.DataFrame(rows), index=False), dtype=np.uint64)
