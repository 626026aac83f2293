"""Resampling of jittery samples to a uniform grid, filters on it, and the noise above the motion's band."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # submodules load lazily

from sidegan.base.arrays import Array

_HIGHEST = 0.8  # of the Nyquist frequency, above which a low-pass has nothing to remove
_ORDER = 4  # of the low-pass, which runs forwards and backwards
_LEAST = 4  # samples of a stretch, as many as the interpolation needs
_BAND = (1.5, 3.0)  # of noise, times the low-pass's cut-off, itself twelve times the motion's bandwidth
_RESOLVED = 0.6  # of the Nyquist frequency, above which interpolation to the grid attenuates noise
_MOST = 200_000  # samples of a part from which noise is estimated
_BLOCK = 16  # cut-off periods per block of the spectrum


@dataclass(frozen=True)
class Grid:
    """Uniform grid and low-pass of a recording's preprocessing."""

    step: float  # of the grid [s]
    gap: float  # longest time that is interpolated over [s]
    bandwidth: float  # of the motion [Hz]
    source: str  # of the bandwidth, for people
    cutoff: float  # of the low-pass [Hz]
    stride: int  # every ``stride``-th sample of the grid is kept

    @property
    def rate(self) -> float:
        """Rate of the kept samples [Hz]."""
        return 1 / (self.step * self.stride)

    @property
    def statement(self) -> str:
        """Grid and filter in words, for people."""
        return (
            f"resampled to {1 / self.step:.4g} Hz (gaps over {self.gap * 1e3:.3g} ms are not crossed), "
            f"zero-phase low-pass at {self.cutoff:.3g} Hz (bandwidth of the motion "
            f"{self.bandwidth:.3g} Hz, {self.source}), {self.rate:.4g} samples per second kept"
        )


@dataclass(frozen=True, eq=False)
class Stretch:
    """A stretch of samples without a gap, and a uniform grid over it."""

    samples: Array  # indices, (S,)
    time: Array  # ascending time stamps [s], (S,)
    step: float  # of the grid [s]
    points: int  # of the grid

    def grid(self, first: int, last: int) -> Array:
        """Times [s] of grid points ``first`` to ``last``, (K,)."""
        return self.time[0] + np.arange(first, last) * self.step

    def at(self, signals: Sequence[Array], first: int, last: int) -> Array:
        """The recording's signals (S, J) at these grid points, (K, C), by monotone cubic interpolation.

        Source: Fritsch, Butland 1984, A method for constructing local monotone piecewise cubic interpolants.
        """
        at = np.minimum(self.grid(first, last), self.time[-1])
        begin, end = np.searchsorted(self.time, at[[0, -1]])
        part = slice(max(0, begin - _LEAST), end + _LEAST)  # interpolation is local
        columns = np.concatenate([x[self.samples[part]] for x in signals], 1).T
        # interpolating all signals at once would take four times the memory
        return np.stack([scipy.interpolate.PchipInterpolator(self.time[part], y)(at) for y in columns], 1)


def continuous_stretches(time: Array, step: float, gap: float) -> Iterator[Stretch]:
    """Stretches of samples at ascending times (S,) [s] between gaps, with a grid of this step [s].

    Samples with a repeated time stamp are left out, and so are those of fewer than four samples or points.
    """
    fresh = np.flatnonzero(np.diff(time, prepend=-np.inf) > 0)
    time = time[fresh]
    cuts = np.flatnonzero(np.diff(time) > gap) + 1
    for samples, t in zip(np.split(fresh, cuts), np.split(time, cuts)):
        points = int((t[-1] - t[0]) / step * (1 + 1e-12) + 1e-9) + 1  # not one fewer by rounding
        if min(len(t), points) >= _LEAST:
            yield Stretch(samples, t, step, points)


def marked_ranges(marked: Array) -> tuple[Array, Array]:
    """First indices of stretches of marked samples (S,), and the indices after their last."""
    edges = np.flatnonzero(np.diff(np.pad(marked, 1)))
    return edges[::2], edges[1::2]


def constant_ranges(signals: Array) -> tuple[Array, Array]:
    """First and last indices of the stretches in which no signal, (S, C), changes."""
    begins = np.append(0, np.flatnonzero((signals[1:] != signals[:-1]).any(1)) + 1)
    return begins, np.append(begins[1:], len(signals)) - 1


def interpolate(at: Array, time: Array, signals: Array, gap: float) -> Array:
    """Signals (S, C) at times (K,) [s], (K, C), as by ``Stretch.at``; NaN outside and in gaps."""
    fresh = np.diff(time, prepend=-np.inf) > 0
    time, signals = time[fresh], signals[fresh]
    values = scipy.interpolate.PchipInterpolator(time, signals, extrapolate=False)(at)
    after = np.searchsorted(time, at).clip(1, len(time) - 1)
    inside = (time[after] - time[after - 1] > gap) & (time[after - 1] < at) & (at < time[after])
    values[inside] = np.nan
    return values


def low_pass(x: Array, cutoff: float, step: float) -> Array:
    """Signals (S, C), low-passed at ``cutoff`` [Hz] without phase shift.

    A Butterworth filter, forwards and backwards; a cut-off near the Nyquist frequency filters nothing.
    """
    if cutoff >= _HIGHEST / (2 * step):
        return x
    sections = scipy.signal.butter(_ORDER, cutoff, fs=1 / step, output="sos")
    pad = min(len(x) - 1, round(3 / (cutoff * step)) + 3 * _ORDER)
    return np.ascontiguousarray(scipy.signal.sosfiltfilt(sections, x, axis=0, padlen=pad))


def derivative(x: Array, step: float) -> Array:
    """Time derivative of signals (S, C), three samples or more, by five-point central differences.

    Signals are extended point-symmetrically at both ends.
    """
    p = np.pad(x, ((2, 2), (0, 0)), "reflect", reflect_type="odd")
    return (p[:-4] - 8 * p[1:-3] + 8 * p[3:-1] - p[4:]) / (12 * step)


def noise_of(torques: Sequence[tuple[Array, Array]], grid: Grid) -> Array:
    """Density of each joint's torque noise [(N·m)²/Hz], (J,), from parts: times (S,) [s], torques (S, J).

    The mean between 1.5 and 3 times the cut-off, of the median over blocks, so that jumps do not count. NaN
    if samples are too few or too far apart.

    Source: Welch 1967, The use of fast Fourier transform for the estimation of power spectra.
    """
    low = _BAND[0] * grid.cutoff
    high = min(_BAND[1] * grid.cutoff, _RESOLVED / (2 * grid.step))
    size = round(_BLOCK / (grid.cutoff * grid.step))
    signals = (
        stretch.at([torque], 0, stretch.points)
        for time, torque in torques
        for stretch in continuous_stretches(time[:_MOST], grid.step, grid.gap)
        if stretch.points >= size
    )
    found, weights = [], []
    for x in signals if low < high else ():
        frequency, density = scipy.signal.welch(x, 1 / grid.step, "hann", size, axis=0, average="median")
        found.append(density[(low <= frequency) & (frequency <= high)].mean(0))
        weights.append(len(x))
    if not found:
        return np.full(torques[0][1].shape[1], math.nan)
    return np.average(found, 0, weights)
