"""Samples that two recordings share, whatever the files are called and wherever in them they are."""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
import pandas as pd

from sidegan.base.arrays import Array
from sidegan.errors import RecordingError
from sidegan.recording.grid import stretches
from sidegan.recording.recording import Recording

_STRETCH = 32  # rows in a row that are no accident
_COUNTED = ("torque", "current", "velocity", "acceleration")  # of these, what both recordings have


class Digests(NamedTuple):
    """Hashes of a recording's rows, by which other recordings that hold the same ones are found."""

    time: Array  # of the rows [s], (S,)
    signals: dict[str, Array]  # by name, (S,) each
    load: str  # of torque and current that from which the arm is identified

    def changing(self, names: Sequence[str]) -> tuple[Array, Array]:
        """Hashes of some signals together and times of rows in which the first of them changes, (K,)."""
        first = self.signals[names[0]]
        keep = np.append(True, first[1:] != first[:-1])
        return _hashes(np.stack([self.signals[name] for name in names], 1))[keep], self.time[keep]


def digests_of(recording: Recording) -> Digests:
    """Digests of a recording's rows, by their numbers in single precision, in which some files keep them."""
    single = {name: x.astype(np.float32) + np.float32(0) for name, x in recording.signals().items()}
    signals = {name: _hashes(x) for name, x in single.items()}
    return Digests(recording.time, signals, recording.load)


def refuse_shared(recordings: Sequence[tuple[str, Digests]]) -> None:
    """Refuse recordings, given with their names, of which two share a stretch of samples or torques."""
    for (first, one), (second, other) in combinations(recordings, 2):
        common = ["position", *(n for n in _COUNTED if n in one.signals and n in other.signals)]
        (mine, _), (theirs, time) = (x.changing(common) for x in (one, other))
        if where := _stretch(np.isin(theirs, mine), time):
            raise RecordingError(
                f"{second} holds samples of {first}, {where}: they would count twice, "
                "or a model would be validated on its own training data"
            )
        (mine, _), (theirs, time) = (x.changing([x.load]) for x in (one, other))
        if where := _stretch(_in_order(mine, theirs), time):
            raise RecordingError(
                f"{second} has the same torques as {first}, {where}, but another motion: "
                "one of the two has the torques of another recording"
            )


def _stretch(common: Array, time: Array) -> str:
    """From when to when the longest stretch of common rows is; nothing where it may be an accident."""
    begins, ends = stretches(common)
    if not (ends - begins >= _STRETCH).any():
        return ""
    longest = int(np.argmax(ends - begins))
    begin, end = time[[begins[longest], ends[longest] - 1]]
    return f"from {begin:.6g} s to {end:.6g} s"


def _in_order(mine: Array, theirs: Array) -> Array:
    """Which of their rows follow each other as mine do; coarse currents are alike by accident."""
    order = np.argsort(mine, kind="stable")
    place = order[np.searchsorted(mine, theirs, sorter=order).clip(max=len(mine) - 1)]
    same = mine[place] == theirs
    next_ = same[1:] & same[:-1] & (place[1:] == place[:-1] + 1)
    return np.append(False, next_) | np.append(next_, False)


def _hashes(rows: Array) -> Array:
    """A hash of each row (S, C), (S,)."""
    return np.asarray(pd.util.hash_pandas_object(pd.DataFrame(rows), index=False), dtype=np.uint64)
