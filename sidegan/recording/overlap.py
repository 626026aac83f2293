"""The same samples in two recordings, whatever the files are called and wherever in them the samples are."""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sidegan.errors import RecordingError
from sidegan.recording.recording import Recording
from sidegan.recording.tables import Numbers

_KEPT = 4  # one in so many rows, chosen by what they hold, so that two files keep the same
_STRETCH = 8  # kept rows in a row, about 32 samples, that are no accident
_FORCES = ("torque", "current")
_COUNTED = ("torque", "current", "velocity", "acceleration")  # of these, what both recordings have

Digests = NDArray[np.uint64]


class Rows(NamedTuple):
    """Digests of some of a recording's rows, and when they are [s]."""

    digests: dict[str, Digests]  # of rows in which the arm moves, (K,) by signal
    time: Numbers  # (K,)
    forces: Digests  # of rows in which its torques or currents change, whatever the arm does, (F,)
    forced: Numbers  # (F,)


def rows_of(part: Recording) -> Rows:
    """Rows of a piece; only one in four of them, for memory's sake."""
    signals, time = {name: _digests(x.numpy()) for name, x in part.signals().items()}, part.time.numpy()
    keep = _kept(signals["position"])
    forces = next((signals[name] for name in _FORCES if name in signals), np.zeros(0, dtype=np.uint64))
    forced = _kept(forces)
    moving = {name: x[keep] for name, x in signals.items()}
    return Rows(moving, time[keep], forces[forced], time[: len(forces)][forced])


def joined(parts: Sequence[Rows]) -> Rows:
    """Rows of consecutive pieces."""
    names = parts[0].digests
    digests = {name: np.concatenate([part.digests[name] for part in parts]) for name in names}
    time, forces, forced = (np.concatenate(one) for one in list(zip(*parts))[1:])
    return Rows(digests, time, forces, forced)


def refuse_shared(recordings: Sequence[tuple[str, Rows]]) -> None:
    """Refuse recordings of which two, given with their names, have a stretch of samples or torques in common.

    Raises:
        RecordingError: names both, and where the stretch is.
    """
    for (first, one), (second, other) in combinations(recordings, 2):
        common = ["position", *(n for n in _COUNTED if n in one.digests and n in other.digests)]
        mine, theirs = (_combined(rows, common) for rows in (one, other))
        if where := _stretch(np.isin(theirs, mine), other.time):
            raise RecordingError(
                f"{second} holds samples of {first}, {where}: they would count twice, "
                "or a model would be tested on what it was made from"
            )
        if where := _stretch(_in_order(one.forces, other.forces), other.forced):
            raise RecordingError(
                f"the torques of {second} are those of {first}, {where}, with other motion: "
                "one of them has torques of another recording"
            )


def _stretch(common: NDArray[np.bool_], time: Numbers) -> str:
    """From when to when the longest stretch of common rows is; nothing where it may be an accident."""
    edges = np.flatnonzero(np.diff(np.pad(common.astype(np.int8), 1)))
    begins, ends = edges[::2], edges[1::2]
    if not (ends - begins >= _STRETCH).any():
        return ""
    longest = int(np.argmax(ends - begins))
    begin, end = time[[begins[longest], ends[longest] - 1]]
    return f"from {begin:.6g} s to {end:.6g} s"


def _in_order(mine: Digests, theirs: Digests) -> NDArray[np.bool_]:
    """Which of their rows follow each other as mine do; coarse currents are alike by accident."""
    if not len(mine) or not len(theirs):
        return np.zeros(len(theirs), dtype=bool)
    order = np.argsort(mine, kind="stable")
    place = order[np.searchsorted(mine, theirs, sorter=order).clip(max=len(mine) - 1)]
    same = mine[place] == theirs
    next_ = same[1:] & same[:-1] & (place[1:] == place[:-1] + 1)
    return np.append(False, next_) | np.append(next_, False)


def _kept(digests: Digests) -> NDArray[np.bool_]:
    """Which rows differ from the one before, and are of the one in four that is kept for what it holds."""
    changed = np.append(True, digests[1:] != digests[:-1]) if len(digests) else np.zeros(0, dtype=bool)
    return changed & (digests % np.uint64(_KEPT) == 0)


def _combined(rows: Rows, names: Sequence[str]) -> Digests:
    total = np.zeros(len(rows.time), dtype=np.uint64)
    for name in names:
        total = _mixed(total ^ rows.digests[name])
    return total


def _digests(x: Numbers) -> Digests:
    """A digest of each row (S, J), of its numbers in single precision, in which some files keep them."""
    total = np.zeros(len(x), dtype=np.uint64)
    with np.errstate(over="ignore"):
        single = (x + 0.0).astype(np.float32)  # no negative zero
    for column in np.ascontiguousarray(single.T):
        total = _mixed(total ^ column.view(np.uint32))
    return total


def _mixed(x: Digests) -> Digests:
    """Every bit depends on every other (splitmix64, Steele, Lea and Flood 2014)."""
    x = x + np.uint64(0x9E3779B97F4A7C15)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))
