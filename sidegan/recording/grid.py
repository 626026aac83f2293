"""From jittery samples to a uniform grid, and filters along it, run by run, in pieces of bounded memory."""

from collections.abc import Iterable, Iterator
from itertools import groupby
from typing import NamedTuple

import numpy as np
import scipy  # its parts are imported when they are used

from sidegan.base.names import counted
from sidegan.errors import RecordingError
from sidegan.recording.tables import Numbers

_HIGHEST = 0.8  # of half the sampling rate: above it there is nothing to filter
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
    values = scipy.interpolate.PchipInterpolator(time, signals)(np.minimum(grid, time[-1]))
    return Block(run, first, grid, np.asarray(values, dtype=np.float64))


def interpolated(at: Numbers, time: Numbers, signals: Numbers, gap: float) -> Numbers:
    """Signals (S, C) at other times, (K, C), as by ``uniform``; NaN outside of them and in gaps.

    Args:
        at: the other times [s], (K,), ascending.
        time: of the signals [s], (S,), ascending; the second of two samples with one stamp is left out.
        signals: (S, C).
        gap: time between samples that is not interpolated over [s].
    """
    fresh = np.diff(time, prepend=-np.inf) > 0
    time, signals = time[fresh], signals[fresh]
    values = np.asarray(scipy.interpolate.PchipInterpolator(time, signals, extrapolate=False)(at))
    after = np.searchsorted(time, at).clip(1, len(time) - 1)
    inside = (time[after] - time[after - 1] > gap) & (time[after - 1] < at) & (at < time[after])
    values[inside] = np.nan
    return values


def low_pass(x: Numbers, cutoff: float, step: float, order: int) -> Numbers:
    """Signals (S, C) without what is faster than ``cutoff`` [Hz], not shifted in time.

    A Butterworth filter forwards and backwards; a cut-off near half the sampling rate filters nothing.

    Raises:
        RecordingError: when there are too few samples.
    """
    if cutoff >= _HIGHEST / (2 * step):
        return x
    sections = scipy.signal.butter(order, cutoff, fs=1 / step, output="sos")
    pad = min(len(x) - 1, round(3 / (cutoff * step)) + 3 * order)
    if pad < 1:
        raise RecordingError(f"{counted(len(x), 'sample')}: too few to filter")
    return np.ascontiguousarray(scipy.signal.sosfiltfilt(sections, x, axis=0, padlen=pad))


def derivative(x: Numbers, step: float) -> Numbers:
    """Time derivative of signals (S, C), by five-point differences.

    Outside of the samples the signal goes on point-symmetrically.
    """
    if len(x) < 3:
        return np.gradient(x, step, axis=0) if len(x) > 1 else np.zeros_like(x)
    p = np.pad(x, ((2, 2), (0, 0)), "reflect", reflect_type="odd")
    return (p[:-4] - 8 * p[1:-3] + 8 * p[3:-1] - p[4:]) / (12 * step)


def windows(blocks: Iterable[Block], halo: int, least: int) -> Iterator[tuple[Block, slice, bool]]:
    """Blocks with up to ``halo`` points of the same run on both sides, and the part that is to be kept.

    Args:
        blocks: consecutive, of any number of runs.
        halo: points on each side that a window shares with its neighbours.
        least: points of a window at least, where the run has so many.

    Yields:
        Window, what of it belongs to no other window, and whether it is the last of its run.
    """
    held: Block | None = None
    done = 0  # points of the held window that an earlier one gave
    for block in blocks:
        if held is not None and block.run != held.run:
            yield held, slice(done, None), True
            held, done = None, 0
        held = block if held is None else _appended(held, block)
        ready = len(held.time) - halo
        if ready - done >= least:
            yield held, slice(done, ready), False
            keep = max(0, ready - halo)
            held = Block(held.run, held.first + keep, held.time[keep:], held.signals[keep:])
            done = ready - keep
    if held is not None:
        yield held, slice(done, None), True


def _appended(a: Block, b: Block) -> Block:
    return Block(a.run, a.first, np.concatenate([a.time, b.time]), np.concatenate([a.signals, b.signals]))
