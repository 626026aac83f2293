"""Signed distances of segments from each other, from planes and from boxes, compiled."""

import math

from sidegan.motion.compiled.chain import Array
from sidegan.motion.compiled.formulas import Vector, add, dot, less, times
from sidegan.motion.compiled.jit import inline
from sidegan.motion.compiled.links import TOUCHING, nearest, row

_HALVINGS = 36  # of a capsule's axis at a box: leaves 1e-11 of its length


@inline
def between_segments(a1: Vector, b1: Vector, a2: Vector, b2: Vector) -> float:
    """Distance [m] between two segments."""
    one, two = nearest(a1, b1, a2, b2)
    gap = less(one, two)
    distance = math.sqrt(dot(gap, gap))
    return TOUCHING if distance < TOUCHING else distance


@inline
def to_plane(numbers: Array, r: int, a: Vector, b: Vector) -> float:
    """Signed distance [m] of a segment to a half space."""
    normal = row(numbers, r)
    return min(dot(normal, a), dot(normal, b)) - numbers[r, 3]


@inline
def point_to_box(x: Vector, half: Vector) -> float:
    """Signed distance [m] of a point from a box at the origin."""
    bx, by, bz = abs(x[0]) - half[0], abs(x[1]) - half[1], abs(x[2]) - half[2]
    beyond = max(bx, 0.0), max(by, 0.0), max(bz, 0.0)
    return max(math.sqrt(dot(beyond, beyond)), TOUCHING) + min(max(bx, by, bz), 0.0)


@inline
def _slope(x: Vector, half: Vector, along: Vector) -> float:
    """What has the sign of the growth of the distance from a box along a direction."""
    beyond = abs(x[0]) - half[0], abs(x[1]) - half[1], abs(x[2]) - half[2]
    farthest = max(beyond[0], beyond[1], beyond[2])
    total = 0.0
    for k in range(3):
        inside = 1.0 if beyond[k] == farthest else 0.0
        size = max(beyond[k], 0.0) if farthest > 0 else inside
        total += math.copysign(size, x[k]) * along[k]
    return total


@inline
def to_box(centre: Vector, half: Vector, a: Vector, b: Vector) -> float:
    """Signed distance [m] of a segment to a box: convex along the segment, so halving finds the least."""
    a, b = less(a, centre), less(b, centre)
    along = less(b, a)
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        if _slope(add(a, times(middle, along)), half, along) < 0:
            low = middle
        else:
            high = middle
    before, after = add(a, times(low, along)), add(a, times(high, along))
    return min(point_to_box(before, half), point_to_box(after, half))
