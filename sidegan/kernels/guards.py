"""Which capsules can stay out of which regions, compiled."""

import numpy as np

from sidegan.kernels.chain import BOX, Array, Shapes
from sidegan.kernels.distances import point_to_box, to_region
from sidegan.kernels.formulas import add, less, times
from sidegan.kernels.jit import inline, kernel
from sidegan.kernels.links import row


@inline
def _outside(shapes: Shapes, r: int, k: int, ends: tuple) -> bool:
    """Whether a capsule is clear of a region."""
    (a, b), numbers = ends, shapes.regions
    middle = times(0.5, add(a, b))
    if shapes.kinds[r] == BOX:
        half = (numbers[r, 3], numbers[r, 4], numbers[r, 5])
        if point_to_box(less(middle, row(numbers, r)), half) <= shapes.radius[k]:
            return False
    return to_region(shapes, r, a, b, middle, shapes.size[k]) > shapes.radius[k]


@kernel
def _mark(shapes: Shapes, moving: Array, ends: Array, leaves: Array) -> None:
    for r in range(len(leaves)):
        for k in range(len(moving)):
            leaves[r, k] = False
            for n in range(ends.shape[2]):
                if _outside(shapes, r, moving[k], (row(ends[0, k], n), row(ends[1, k], n))):
                    leaves[r, k] = True
                    break


def leaving(shapes: Shapes, moving: Array, ends: Array) -> Array:
    """Whether moving capsules are clear of the regions in any of N configurations, (R, C) bool.

    Args:
        shapes: capsules and regions.
        moving: which of the capsules move, (C,).
        ends: of their axes in the world [m], (2, C, N, 3).
    """
    leaves = np.zeros((len(shapes.regions), len(moving)), bool)
    _mark(shapes, moving, ends, leaves)
    return leaves
