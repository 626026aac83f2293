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
_COUNTED = ("torque", "current", "velocity", "acceleration")  # of these, what both recordings have

Digests = NDArray[np.uint64]


class Rows(NamedTuple):
    """Digests of some of a recording's rows in which the arm moves, (K,) by signal, and when they are."""

    digests: dict[str, Digests]
    time: Numbers  # [s], (K,)


def rows_of(part: Recording) -> Rows:
    """Rows of a piece; only one in four of them, for memory's sake."""
    signals = {name: _digests(x.numpy()) for name, x in part.signals().items()}
    position = signals["position"]
    moved = np.append(True, position[1:] != position[:-1]) if len(position) else np.zeros(0, dtype=bool)
    keep = moved & (position % np.uint64(_KEPT) == 0)
    return Rows({name: x[keep] for name, x in signals.items()}, part.time.numpy()[keep])


def joined(parts: Sequence[Rows]) -> Rows:
    """Rows of consecutive pieces."""
    names = parts[0].digests
    digests = {name: np.concatenate([part.digests[name] for part in parts]) for name in names}
    return Rows(digests, np.concatenate([part.time for part in parts]))


def refuse_shared(recordings: Sequence[tuple[str, Rows]]) -> None:
    """Refuse recordings of which two, given with their names, have a stretch of samples in common.

    Raises:
        RecordingError: names both, and where the stretch is.
    """
    for (first, one), (second, other) in combinations(recordings, 2):
        common = ["position", *(n for n in _COUNTED if n in one.digests and n in other.digests)]
        mine, theirs = (_combined(rows, common) for rows in (one, other))
        both = np.isin(theirs, mine)
        edges = np.flatnonzero(np.diff(np.pad(both.astype(np.int8), 1)))
        begins, ends = edges[::2], edges[1::2]
        if not (ends - begins >= _STRETCH).any():
            continue
        longest = int(np.argmax(ends - begins))
        begin, end = other.time[[begins[longest], ends[longest] - 1]]
        raise RecordingError(
            f"{second} holds samples of {first}, from {begin:.6g} s to {end:.6g} s: they would count twice, "
            "or a model would be tested on what it was made from"
        )


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
