"""Hysteresis of a torque sensor: its strain lags behind the load, whatever the speed.

A Prandtl–Ishlinskii operator of a few stops. What a stop holds follows the load up to its radius, and slips
there: only the order of the load's reversals counts, and a larger swing wipes out what smaller ones left.

Source: Brokate, Sprekels 1996, Hysteresis and Phase Transitions.
"""

import numpy as np

from sidegan.base.arrays import Array

RADII = np.array([0.125, 0.25, 0.5])  # of the stops, in shares of the range: an assumption


def stops(load: Array, radii: Array) -> Array:
    """What stops hold of a load (B, T, J) that begins at zero, (R, B, T, J), of radii (R, J) in its unit."""
    held, bound = np.empty((len(radii), *load.shape)), radii[:, None]
    now, before = np.zeros((len(radii), *load[:, 0].shape)), np.zeros_like(load[:, 0])
    for i in range(load.shape[1]):
        now = np.clip(now + (load[:, i] - before), -bound, bound)
        held[:, :, i], before = now, load[:, i]
    return held


def lagging(load: Array, full: Array, share: float) -> Array:
    """A load (B, T, J) as a sensor of range ±``full``, (J,), tells it, in the load's unit.

    ``share`` of the range is half the width, at zero, of the loop over all of it, and the largest error.
    """
    held = stops(load, RADII[:, None] * full)
    return load - share / RADII.sum() * held.sum(0)
