"""How far capsules come too close to each other or to a region, and the slope of its square; for kernels."""

import math

from sidegan.kernels.chain import BALL, BOX, CONVEX, PLANE, Array, Shapes
from sidegan.kernels.distances import lowest_crossing, nearest_to_box, outwards, point_to_box
from sidegan.kernels.formulas import Vector, add, dot, less, times
from sidegan.kernels.jit import inline
from sidegan.kernels.links import TOUCHING, nearest, row

Span = tuple[int, int]  # two indices
Segment = tuple[Vector, Vector]  # the ends of a capsule's axis


@inline
def pull_of_pair(
    shapes: Shapes, pair: Span, reach: float, one: Segment, two: Segment
) -> tuple[float, Vector, Vector, Vector]:
    """How far two capsules fall short of ``reach`` [m], their nearest points, and a slope.

    The slope is that of the square in the first point; in the second it is the opposite. It is nothing where
    the axes cross.
    """
    i, k = pair
    a, b = nearest(one[0], one[1], two[0], two[1])
    gap = less(a, b)
    distance = math.sqrt(dot(gap, gap))
    excess = reach - max(distance, TOUCHING) + shapes.core[i] + shapes.core[k]
    return excess, a, b, times(-2 * excess / distance if distance > TOUCHING else 0.0, gap)


@inline
def _near_ball(centre: Vector, radius: float, a: Vector, b: Vector) -> tuple[float, Vector, Vector]:
    """Signed distance [m] of a segment to a ball, its nearest point and the direction away."""
    point, _ = nearest(a, b, centre, centre)
    gap = less(point, centre)
    distance = max(math.sqrt(dot(gap, gap)), TOUCHING)
    return distance - radius, point, times(1 / distance, gap)


@inline
def _near_body(shapes: Shapes, r: int, a: Vector, b: Vector) -> tuple[float, Vector, Vector]:
    """The same for a convex body: away from both planes that cross at the nearest point."""
    first, last = int(shapes.regions[r, 4]), int(shapes.regions[r, 5])
    distance, share, one, two, part = lowest_crossing(shapes.planes, first, last, a, b)
    planes = shapes.planes
    ways = (planes[one, 0], planes[one, 1], planes[one, 2]), (planes[two, 0], planes[two, 1], planes[two, 2])
    away = add(times(1 - part, ways[0]), times(part, ways[1]))
    return distance, add(times(1 - share, a), times(share, b)), away


@inline
def _near_box(numbers: Array, r: int, a: Vector, b: Vector) -> tuple[float, Vector, Vector]:
    """The same for a box that the segment does not pierce."""
    centre, half = row(numbers, r), (numbers[r, 3], numbers[r, 4], numbers[r, 5])
    inside = less(a, centre)
    distance, share, _, _ = nearest_to_box(half, inside, less(b, centre))
    point = add(inside, times(share, less(b, a)))
    return distance, add(point, centre), outwards(point, half)


@inline
def near_region(shapes: Shapes, r: int, a: Vector, b: Vector) -> tuple[float, Vector, Vector]:
    """The same for any region; a box may be left along two faces at once where a segment pierces it."""
    if shapes.kinds[r] == BALL:
        return _near_ball(row(shapes.regions, r), shapes.regions[r, 3], a, b)
    if shapes.kinds[r] == CONVEX:
        return _near_body(shapes, r, a, b)
    if shapes.kinds[r] == BOX:
        return _near_box(shapes.regions, r, a, b)
    normal = row(shapes.regions, r)
    low, high = dot(normal, a), dot(normal, b)
    return min(low, high) - shapes.regions[r, 3], a if low < high else b, normal


@inline
def from_region(shapes: Shapes, r: int, x: Vector) -> float:
    """Distance [m] of a point from a region, or less."""
    numbers, kind = shapes.regions, shapes.kinds[r]
    if kind == PLANE:
        return dot(row(numbers, r), x) - numbers[r, 3]
    apart = less(x, row(numbers, r))
    if kind == BOX:
        return point_to_box(apart, (numbers[r, 3], numbers[r, 4], numbers[r, 5]))
    return math.sqrt(dot(apart, apart)) - numbers[r, 3]


@inline
def pull_of_region(
    shapes: Shapes, guard: Span, reach: float, a: Vector, b: Vector
) -> tuple[float, Vector, Vector, Vector, Vector]:
    """How far a capsule falls short of ``reach`` from a region [m], and two points with their slopes.

    The slopes are those of the square; only in a box, which is left along two faces, are both something.
    """
    r, k = guard
    if shapes.kinds[r] != BOX:
        distance, point, away = near_region(shapes, r, a, b)
        excess = reach - distance + shapes.radius[k]
        return excess, point, times(-2 * excess, away), point, (0.0, 0.0, 0.0)
    numbers = shapes.regions
    centre, half = row(numbers, r), (numbers[r, 3], numbers[r, 4], numbers[r, 5])
    inside, along = less(a, centre), less(b, a)
    distance, before, after, share = nearest_to_box(half, inside, less(b, centre))
    excess = reach - distance + shapes.radius[k]
    one, two = add(inside, times(before, along)), add(inside, times(after, along))
    force = times(-2 * excess * share, outwards(one, half))
    other = times(-2 * excess * (1.0 - share), outwards(two, half))
    return excess, add(one, centre), force, add(two, centre), other
