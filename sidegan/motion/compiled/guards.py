"""Which capsules can stay out of which regions, compiled."""

import numpy as np

from sidegan.motion.compiled.chain import PLANE, Array
from sidegan.motion.compiled.distances import point_to_box, to_box, to_plane
from sidegan.motion.compiled.formulas import add, less, times
from sidegan.motion.compiled.jit import inline, kernel
from sidegan.motion.compiled.links import row


@inline
def _outside(numbers: Array, kinds: Array, r: int, ends: tuple, radius: float) -> bool:
    """Whether a capsule is clear of a region."""
    a, b = ends
    if kinds[r] == PLANE:
        return to_plane(numbers, r, a, b) > radius
    centre, half = row(numbers, r), (numbers[r, 3], numbers[r, 4], numbers[r, 5])
    if point_to_box(less(times(0.5, add(a, b)), centre), half) <= radius:
        return False
    return to_box(centre, half, a, b) > radius


@kernel
def _mark(ends: Array, radius: Array, numbers: Array, kinds: Array, leaves: Array) -> None:
    for r in range(len(numbers)):
        for k in range(len(radius)):
            leaves[r, k] = False
            for n in range(ends.shape[2]):
                if _outside(numbers, kinds, r, (row(ends[0, k], n), row(ends[1, k], n)), radius[k]):
                    leaves[r, k] = True
                    break


def leaving(ends: Array, radius: Array, numbers: Array, kinds: Array) -> Array:
    """Whether capsules are clear of regions in any of N configurations, (R, C) bool.

    Args:
        ends: of the capsules' axes in the world [m], (2, C, N, 3).
        radius: of the capsules [m], (C,).
        numbers: of the regions, (R, 6).
        kinds: of the regions, (R,).
    """
    leaves = np.zeros((len(numbers), len(radius)), bool)
    _mark(ends, radius, numbers, kinds, leaves)
    return leaves
