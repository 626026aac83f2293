"""From jittery samples to a uniform grid, filters along it, and the noise above the motion."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # its parts are imported when they are used

from sidegan.base.arrays import Array

_HIGHEST = 0.8  # of half the sampling rate: above it there is nothing to filter
_ORDER = 4  # of the low-pass, which is run forwards and backwards
_LEAST = 4  # samples of a run: the interpolation looks at so many
_BAND = (1.5, 3.0)  # times the cut-off of the low-pass, itself twelve times the bandwidth of the motion
_RESOLVED = 0.6  # of half the sampling rate: above it, interpolation to the grid takes noise away
_MOST = 200_000  # samples of a part that are looked at
_BLOCK = 16  # periods of the cut-off in a block of the spectrum


@dataclass(frozen=True)
class Grid:
    """Uniform grid and low-pass that a recording is preprocessed with; ``statement`` says it to people."""

    step: float  # of the grid [s]
    gap: float  # longest time that is interpolated over [s]
    bandwidth: float  # of the motion [Hz]
    source: str  # of the bandwidth, for people
    cutoff: float  # of the low-pass [Hz]
    stride: int  # every so manieth sample of the grid is kept

    @property
    def rate(self) -> float:
        """Rate of the samples that are kept [Hz]."""
        return 1 / (self.step * self.stride)

    @property
    def statement(self) -> str:
        """The grid and the filter in words."""
        return (
            f"resampled to {1 / self.step:.4g} Hz (gaps over {self.gap * 1e3:.3g} ms are not crossed), "
            f"zero-phase low-pass at {self.cutoff:.3g} Hz (bandwidth of the motion "
            f"{self.bandwidth:.3g} Hz, {self.source}), {self.rate:.4g} samples per second kept"
        )


@dataclass(frozen=True, eq=False)
class Run:
    """A stretch of samples without a gap, and a uniform grid along it."""

    samples: Array  # their numbers, (S,)
    time: Array  # their stamps [s], (S,), which ascend
    step: float  # of the grid [s]
    points: int  # of the grid

    def grid(self, first: int, last: int) -> Array:
        """Times [s] of points of the grid from one number to another, (K,)."""
        return self.time[0] + np.arange(first, last) * self.step

    def at(self, signals: Sequence[Array], first: int, last: int) -> Array:
        """Signals (S, J) of the recording at these points, (K, C), by monotone cubic interpolation.

        Source: Fritsch, Butland 1984, A method for constructing local monotone piecewise cubic interpolants.
        """
        at = np.minimum(self.grid(first, last), self.time[-1])
        begin, end = np.searchsorted(self.time, at[[0, -1]])
        part = slice(max(0, begin - _LEAST), end + _LEAST)  # the curves depend on no others
        columns = np.concatenate([x[self.samples[part]] for x in signals], 1).T
        # a curve of all signals at once would take four times the memory
        return np.stack([scipy.interpolate.PchipInterpolator(self.time[part], y)(at) for y in columns], 1)


def runs(time: Array, step: float, gap: float) -> Iterator[Run]:
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


def stretches(marked: Array) -> tuple[Array, Array]:
    """Numbers of the first samples of stretches in which (S,) are marked, and of those after their last."""
    edges = np.flatnonzero(np.diff(np.pad(marked, 1)))
    return edges[::2], edges[1::2]


def interpolated(at: Array, time: Array, signals: Array, gap: float) -> Array:
    """Signals (S, C) at other times (K,) [s], (K, C), as by ``Run.at``; NaN outside and in gaps."""
    fresh = np.diff(time, prepend=-np.inf) > 0
    time, signals = time[fresh], signals[fresh]
    values = scipy.interpolate.PchipInterpolator(time, signals, extrapolate=False)(at)
    after = np.searchsorted(time, at).clip(1, len(time) - 1)
    inside = (time[after] - time[after - 1] > gap) & (time[after - 1] < at) & (at < time[after])
    values[inside] = np.nan
    return values


def low_pass(x: Array, cutoff: float, step: float) -> Array:
    """Signals (S, C) without what is faster than ``cutoff`` [Hz], not shifted in time.

    A Butterworth filter forwards and backwards; a cut-off near half the sampling rate filters nothing.
    """
    if cutoff >= _HIGHEST / (2 * step):
        return x
    sections = scipy.signal.butter(_ORDER, cutoff, fs=1 / step, output="sos")
    pad = min(len(x) - 1, round(3 / (cutoff * step)) + 3 * _ORDER)
    return np.ascontiguousarray(scipy.signal.sosfiltfilt(sections, x, axis=0, padlen=pad))


def derivative(x: Array, step: float) -> Array:
    """Time derivative of signals (S, C) of three samples or more, by five-point differences.

    Outside of the samples the signal goes on point-symmetrically.
    """
    p = np.pad(x, ((2, 2), (0, 0)), "reflect", reflect_type="odd")
    return (p[:-4] - 8 * p[1:-3] + 8 * p[3:-1] - p[4:]) / (12 * step)


def noise_of(torques: Sequence[tuple[Array, Array]], grid: Grid) -> Array:
    """Density of each joint's torque noise [(N·m)²/Hz], (J,), of times (S,) [s] and torques (S, J) in parts.

    It is that between 1.5 and 3 times the cut-off, the median over blocks, so that a jump is no noise. NaN
    where samples are too few or too far apart to tell.

    Source: Welch 1967, The use of fast Fourier transform for the estimation of power spectra.
    """
    low, high = _BAND[0] * grid.cutoff, min(_BAND[1] * grid.cutoff, _RESOLVED / (2 * grid.step))
    size = round(_BLOCK / (grid.cutoff * grid.step))
    each = (
        run.at([torque], 0, run.points)
        for time, torque in torques
        for run in runs(time[:_MOST], grid.step, grid.gap)
        if run.points >= size
    )
    found, weights = [], []
    for x in each if low < high else ():
        frequency, density = scipy.signal.welch(x, 1 / grid.step, "hann", size, axis=0, average="median")
        found.append(density[(low <= frequency) & (frequency <= high)].mean(0))
        weights.append(len(x))
    if not found:
        return np.full(torques[0][1].shape[1], math.nan)
    return np.average(found, 0, weights)
