"""Rate-independent hysteresis of a torque sensor.

A Prandtl–Ishlinskii operator of a few stops. Each stop follows the load up to its radius, where it slips:
only the sequence of the load's reversals counts, and larger swings erase the memory of smaller ones.

Source: Brokate, Sprekels 1996, Hysteresis and Phase Transitions.
"""

import numpy as np

from sidegan.base.arrays import Array

RADII = np.array([0.125, 0.25, 0.5])  # of the stops, as shares of the range: an assumption


def lagging(load: Array, full: Array, share: float) -> Array:
    """Reading of a sensor of range ±``full``, (J,), for a load (B, T, J) that starts from zero, in its unit.

    ``share`` of the range is the largest error, half the width at zero of the loop over the whole range.
    """
    from sidegan.kernels.servos import slipped  # numba is slow to import

    held = np.zeros_like(load)
    slipped(load, RADII[:, None] * full, held)
    return load - share / RADII.sum() * held
