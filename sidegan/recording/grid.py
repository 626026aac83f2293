"""From jittery samples to a uniform grid, run by run, in pieces of bounded memory."""

from collections.abc import Iterable, Iterator
from itertools import groupby
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from sidegan.recording.tables import Numbers

_LEAST = 4  # samples of a run: the interpolation looks at so many


class Block(NamedTuple):
    """Consecutive points of a uniform grid."""

    run: int  # number of the stretch without gaps
    first: int  # index of the first point in its run
    time: Numbers  # [s], (S,)
    signals: Numbers  # (S, C)


def uniform(pieces: Iterable[tuple[Numbers, Numbers]], step: float, gap: float) -> Iterator[Block]:
    """Grid points of every run, by monotone cubic interpolation, which looks at four samples.

    The second of two samples with the same time stamp is left out, and so is a run of fewer than four.

    Args:
        pieces: time (S,) and signals (S, C) of consecutive samples.
        step: of the grid [s].
        gap: time between samples that ends a run [s].

    Source: Fritsch, Butland 1984, A method for constructing local monotone piecewise cubic interpolants.
    """
    for run, parts in groupby(_runs(pieces, gap), key=lambda part: part[0]):
        yield from _resampled(run, ((time, signals) for _, time, signals in parts), step)


def _runs(pieces: Iterable[tuple[Numbers, Numbers]], gap: float) -> Iterator[tuple[int, Numbers, Numbers]]:
    """The same samples cut at gaps, with the number of the run, without duplicates."""
    run, last = 0, -np.inf
    for time, signals in pieces:
        fresh = np.diff(time, prepend=last) > 0
        time, signals = time[fresh], signals[fresh]
        if not len(time):
            continue
        cuts = np.flatnonzero(np.diff(time, prepend=time[0] if last == -np.inf else last) > gap)
        last = time[-1]
        for k, (t, x) in enumerate(zip(np.split(time, cuts), np.split(signals, cuts))):
            run += k > 0
            if len(t):
                yield run, t, x


def _resampled(run: int, parts: Iterator[tuple[Numbers, Numbers]], step: float) -> Iterator[Block]:
    """One run's grid points. A point needs two samples on each side: the last ones wait for the next part."""
    time, signals = next(parts)
    origin, first = time[0], 0
    rest: tuple[Numbers, Numbers] | None = None
    for rest in parts:
        settled = max(0, len(time) - 2)  # up to the last sample but one, nothing to come changes the curve
        count = _points(origin, first, time[settled], step) if settled else first
        if count > first and len(time) >= _LEAST:
            yield _block(run, first, count, origin, step, time, signals)
            first = count
            keep = max(0, int(np.searchsorted(time, origin + first * step)) - 3)
            time, signals = time[keep:], signals[keep:]
        time, signals = np.concatenate([time, rest[0]]), np.concatenate([signals, rest[1]])
    count = _points(origin, first, time[-1], step)
    if count > first and len(time) >= _LEAST:
        yield _block(run, first, count, origin, step, time, signals)


def _points(origin: float, first: int, until: float, step: float) -> int:
    """One more than the index of the last grid point up to ``until``; rounding does not lose one."""
    return max(first, int(np.floor((until - origin) / step * (1 + 1e-12) + 1e-9)) + 1)


def _block(
    run: int, first: int, count: int, origin: float, step: float, time: Numbers, signals: Numbers
) -> Block:
    grid = np.asarray(origin + np.arange(first, count) * step, dtype=np.float64)
    values = PchipInterpolator(time, signals)(np.minimum(grid, time[-1]))
    return Block(run, first, grid, np.asarray(values, dtype=np.float64))
