"""Noise of recorded torques: what they hold where no arm's motion is."""

import math
from collections.abc import Sequence

import numpy as np
import scipy  # its parts are imported when they are used

from sidegan.base.arrays import Array
from sidegan.recording.grid import runs
from sidegan.recording.segments import Grid
from sidegan.recording.tables import Numbers

_BAND = (1.5, 3.0)  # times the cut-off of the low-pass, itself twelve times the bandwidth of the motion
_RESOLVED = 0.6  # of half the sampling rate: above it, interpolation to the grid takes noise away
_MOST = 200_000  # samples of a part that are looked at
_BLOCK = 16  # periods of the cut-off in a block of the spectrum


def noise_of(torques: Sequence[tuple[Numbers, Numbers]], grid: Grid) -> Array:
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
