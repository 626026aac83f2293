"""Hysteresis of a torque sensor: its strain lags behind the load, whatever the speed.

A Prandtl–Ishlinskii operator of a few stops. What a stop holds follows the load up to its radius, and slips
there: only the order of the load's reversals counts, and a larger swing wipes out what smaller ones left.

Source: Brokate, Sprekels 1996, Hysteresis and Phase Transitions.
"""

import numpy as np

from sidegan.base.arrays import Array

RADII = np.array([0.125, 0.25, 0.5])  # of the stops, in shares of the range: an assumption


def lagging(load: Array, full: Array, share: float) -> Array:
    """A load (B, T, J) from zero on as a sensor of range ±``full``, (J,), tells it, in the load's unit.

    ``share`` of the range is half the width, at zero, of the loop over all of it, and the largest error.
    """
    bound = (RADII[:, None] * full)[:, None]
    told, before = np.empty_like(load), np.zeros_like(load[:, 0])
    held = np.zeros((len(RADII), *before.shape))
    for i in range(load.shape[1]):
        held = np.clip(held + (load[:, i] - before), -bound, bound)  # of the stops, (R, B, J)
        before = load[:, i]
        told[:, i] = before - share / RADII.sum() * held.sum(0)
    return told
