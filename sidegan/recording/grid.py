"""From jittery samples to a uniform grid, and filters along it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # its parts are imported when they are used
from numpy.typing import NDArray

from sidegan.recording.tables import Numbers

_HIGHEST = 0.8  # of half the sampling rate: above it there is nothing to filter
_ORDER = 4  # of the low-pass, which is run forwards and backwards
_LEAST = 4  # samples of a run: the interpolation looks at so many


@dataclass(frozen=True, eq=False)
class Run:
    """A stretch of samples without a gap, and a uniform grid along it."""

    samples: NDArray[np.int64]  # their numbers, (S,)
    time: Numbers  # their stamps [s], (S,), which ascend
    step: float  # of the grid [s]
    points: int  # of the grid

    def grid(self, first: int, last: int) -> Numbers:
        """Times [s] of points of the grid from one number to another, (K,)."""
        return np.asarray(self.time[0] + np.arange(first, last) * self.step)

    def at(self, signals: Sequence[Numbers], first: int, last: int) -> Numbers:
        """Signals (S, J) of the recording at these points, (K, C), by monotone cubic interpolation.

        Source: Fritsch, Butland 1984, A method for constructing local monotone piecewise cubic interpolants.
        """
        at = np.minimum(self.grid(first, last), self.time[-1])
        begin, end = np.searchsorted(self.time, at[[0, -1]])
        part = slice(max(0, begin - _LEAST), end + _LEAST)  # the curves depend on no others
        columns = np.concatenate([x[self.samples[part]] for x in signals], 1).T
        # a curve of all signals at once would take four times the memory
        return np.stack([scipy.interpolate.PchipInterpolator(self.time[part], y)(at) for y in columns], 1)


def runs(time: Numbers, step: float, gap: float) -> Iterator[Run]:
    """Stretches of samples at ascending times (S,) between gaps [s], with a grid of this step [s].

    The second of two samples with one stamp is left out, and so is a run of fewer than four samples, before
    or on the grid.
    """
    fresh = np.flatnonzero(np.diff(time, prepend=-np.inf) > 0)
    time = time[fresh]
    cuts = np.flatnonzero(np.diff(time) > gap) + 1
    for samples, t in zip(np.split(fresh, cuts), np.split(time, cuts)):
        points = int((t[-1] - t[0]) / step * (1 + 1e-12) + 1e-9) + 1  # rounding does not lose one
        if min(len(t), points) >= _LEAST:
            yield Run(samples, t, step, points)


def interpolated(at: Numbers, time: Numbers, signals: Numbers, gap: float) -> Numbers:
    """Signals (S, C) at other times (K,) [s], (K, C), as by ``Run.at``; NaN outside and in gaps."""
    fresh = np.diff(time, prepend=-np.inf) > 0
    time, signals = time[fresh], signals[fresh]
    values = np.asarray(scipy.interpolate.PchipInterpolator(time, signals, extrapolate=False)(at))
    after = np.searchsorted(time, at).clip(1, len(time) - 1)
    inside = (time[after] - time[after - 1] > gap) & (time[after - 1] < at) & (at < time[after])
    values[inside] = np.nan
    return values


def low_pass(x: Numbers, cutoff: float, step: float) -> Numbers:
    """Signals (S, C) without what is faster than ``cutoff`` [Hz], not shifted in time.

    A Butterworth filter forwards and backwards; a cut-off near half the sampling rate filters nothing.
    """
    if cutoff >= _HIGHEST / (2 * step):
        return x
    sections = scipy.signal.butter(_ORDER, cutoff, fs=1 / step, output="sos")
    pad = min(len(x) - 1, round(3 / (cutoff * step)) + 3 * _ORDER)
    return np.ascontiguousarray(scipy.signal.sosfiltfilt(sections, x, axis=0, padlen=pad))


def derivative(x: Numbers, step: float) -> Numbers:
    """Time derivative of signals (S, C) of three samples or more, by five-point differences.

    Outside of the samples the signal goes on point-symmetrically.
    """
    p = np.pad(x, ((2, 2), (0, 0)), "reflect", reflect_type="odd")
    return (p[:-4] - 8 * p[1:-3] + 8 * p[3:-1] - p[4:]) / (12 * step)
