"""From jittery samples to a uniform grid, and filters along it."""

from collections.abc import Iterator

import numpy as np
import scipy  # its parts are imported when they are used

from sidegan.recording.tables import Numbers

_HIGHEST = 0.8  # of half the sampling rate: above it there is nothing to filter
_ORDER = 4  # of the low-pass, which is run forwards and backwards
_LEAST = 4  # samples of a run: the interpolation looks at so many


def uniform(time: Numbers, signals: Numbers, step: float, gap: float) -> Iterator[tuple[Numbers, Numbers]]:
    """Time (K,) and signals (K, C) on a grid, run by run, by monotone cubic interpolation.

    Times (S,) of signals (S, C) ascend. The second of two samples with one stamp is left out; a gap [s] ends
    a run, and one of fewer than four samples is left out, before or on the grid.

    Source: Fritsch, Butland 1984, A method for constructing local monotone piecewise cubic interpolants.
    """
    time, signals = _fresh(time, signals)
    cuts = np.flatnonzero(np.diff(time) > gap) + 1
    for t, x in zip(np.split(time, cuts), np.split(signals, cuts)):
        steps = np.floor((t[-1] - t[0]) / step * (1 + 1e-12) + 1e-9)  # rounding does not lose one
        if min(len(t), steps + 1) >= _LEAST:
            grid = t[0] + np.arange(steps + 1) * step
            at = np.minimum(grid, t[-1])
            # a curve of all signals at once would take four times the memory of the recording
            yield grid, np.stack([scipy.interpolate.PchipInterpolator(t, y)(at) for y in x.T], 1)


def interpolated(at: Numbers, time: Numbers, signals: Numbers, gap: float) -> Numbers:
    """Signals (S, C) at other times (K,) [s], (K, C), as by ``uniform``; NaN outside and in gaps."""
    time, signals = _fresh(time, signals)
    values = np.asarray(scipy.interpolate.PchipInterpolator(time, signals, extrapolate=False)(at))
    after = np.searchsorted(time, at).clip(1, len(time) - 1)
    inside = (time[after] - time[after - 1] > gap) & (time[after - 1] < at) & (at < time[after])
    values[inside] = np.nan
    return values


def _fresh(time: Numbers, signals: Numbers) -> tuple[Numbers, Numbers]:
    """Samples but for those with the time stamp of the one before."""
    fresh = np.diff(time, prepend=-np.inf) > 0
    return time[fresh], signals[fresh]


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
