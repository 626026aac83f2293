"""Compiled nearest points of segments to each other and to keep-out regions, with directions away.

Shared by the proof, the penalty and the evaluation.
"""

import math

from sidegan.base.arrays import Array
from sidegan.kernels.chain import BALL, BOX, PLANE, Shapes
from sidegan.kernels.formulas import Vector, add, dot, less, scale
from sidegan.kernels.jit import inline, kernel
from sidegan.kernels.links import TOUCHING, row

# Signed distance [m] of a segment from a region, its point on the segment, and its gradient in that point.
Contact = tuple[float, Vector, Vector]

_STEPS = 60  # maximum steps of the search along a segment near a convex body; five are typical
_SETTLED = 1e-12  # [m] between lower bound and result at convergence
_PARALLEL = 1e-15  # squared sines of angles below this are rounding noise
_TINY = 2.2250738585072014e-308  # avoids division by zero


@inline
def _share(x: float) -> float:
    return min(max(x, 0.0), 1.0)


@inline
def near_segment(a1: Vector, b1: Vector, a2: Vector, b2: Vector) -> tuple[float, Vector, Vector]:
    """Distance [m] between two segments, and their nearest points. Source: Ericson 2005, section 5.1.9."""
    u, v, r = less(b1, a1), less(b2, a2), less(a1, a2)
    uu, vv, uv, ur, vr = dot(u, u), dot(v, v), dot(u, v), dot(u, r), dot(v, r)
    determinant = uu * vv - uv * uv
    s = 0.0
    if determinant > _PARALLEL * uu * vv:
        s = _share((uv * vr - ur * vv) / max(determinant, _TINY))
    t = _share((uv * s + vr) / max(vv, _TINY))
    s = _share((uv * t - ur) / max(uu, _TINY))
    one, two = add(a1, scale(s, u)), add(a2, scale(t, v))
    gap = less(one, two)
    distance = math.sqrt(dot(gap, gap))
    return TOUCHING if distance < TOUCHING else distance, one, two


@inline
def from_region(shapes: Shapes, r: int, x: Vector) -> float:
    """Signed distance [m] of a point from a region, or from the bounding ball of a convex body."""
    numbers, kind = shapes.regions, shapes.kinds[r]
    if kind == PLANE:
        return dot(row(numbers, r), x) - numbers[r, 3]
    apart = less(x, row(numbers, r))
    if kind == BOX:
        half = numbers[r, 3], numbers[r, 4], numbers[r, 5]
        beyond = _beyond(apart, half)
        depth = max(abs(apart[0]) - half[0], abs(apart[1]) - half[1], abs(apart[2]) - half[2])
        return min(depth, 0.0) + math.sqrt(dot(beyond, beyond))
    return math.sqrt(dot(apart, apart)) - numbers[r, 3]


@kernel
def near_region(shapes: Shapes, r: int, a: Vector, b: Vector) -> Contact:
    """Contact where a segment is nearest to a region, or deepest inside it.

    A box that the segment pierces is handled as a convex body: inside, its highest plane is the nearest face.
    """
    numbers, kind, centre = shapes.regions, shapes.kinds[r], row(shapes.regions, r)
    if kind == PLANE:
        low, high = dot(centre, a), dot(centre, b)
        return min(low, high) - numbers[r, 3], a if low < high else b, centre
    if kind == BALL:
        distance, point, _ = near_segment(a, b, centre, centre)
        return distance - numbers[r, 3], point, scale(1 / distance, less(point, centre))
    if kind == BOX:
        half, start, along = (numbers[r, 3], numbers[r, 4], numbers[r, 5]), less(a, centre), less(b, a)
        share = _nearest_to_box(half, start, along)
        beyond = _beyond(add(start, scale(share, along)), half)
        distance = math.sqrt(dot(beyond, beyond))
        if distance > TOUCHING:
            return distance, add(a, scale(share, along)), scale(1 / distance, beyond)
    return _near_body(shapes.planes, int(numbers[r, 6]), int(numbers[r, 7]), a, b)


@inline
def _height(planes: Array, k: int, x: Vector) -> float:
    return planes[k, 0] * x[0] + planes[k, 1] * x[1] + planes[k, 2] * x[2] - planes[k, 3]


@kernel
def _highest(planes: Array, first: int, last: int, x: Vector) -> int:
    """Index of the plane, from ``first`` to ``last``, that a point is highest above."""
    best, most = first, -math.inf
    for k in range(first, last):
        height = _height(planes, k, x)
        if height > most:
            best, most = k, height
    return best


@inline
def _near_body(planes: Array, first: int, last: int, a: Vector, b: Vector) -> Contact:
    """Contact where a segment's height above the highest of a convex body's planes is least.

    That is where the heights above two planes are equal, or an end point. The direction blends the normals.
    """
    one, two = _highest(planes, first, last, a), _highest(planes, first, last, b)
    bound, share, part = -math.inf, 0.0, 0.0  # height; position between a and b; weight of the second plane
    for _ in range(_STEPS):
        low, high = _height(planes, one, a), _height(planes, two, b)
        falls, rises = _height(planes, one, b) - low, high - _height(planes, two, a)
        if falls >= 0:
            bound, share, part = low, 0.0, 0.0
            break
        if rises <= 0:
            bound, share, part = high, 1.0, 1.0
            break
        share = _share((low - (high - rises)) / (rises - falls))
        bound, part = low + falls * share, -falls / (rises - falls)
        x = add(a, scale(share, less(b, a)))
        top = _highest(planes, first, last, x)
        if _height(planes, top, x) <= bound + _SETTLED:
            break
        if _height(planes, top, b) > _height(planes, top, a):
            two = top
        else:
            one = top
    point = add(scale(1 - share, a), scale(share, b))
    away = add(scale(1 - part, row(planes, one)), scale(part, row(planes, two)))
    return bound, point, away


@inline
def _beyond(x: Vector, half: Vector) -> Vector:
    """Vector to a point from the nearest point of a box centred at the origin; zero inside the box."""
    return (
        math.copysign(max(abs(x[0]) - half[0], 0.0), x[0]),
        math.copysign(max(abs(x[1]) - half[1], 0.0), x[1]),
        math.copysign(max(abs(x[2]) - half[2], 0.0), x[2]),
    )


@inline
def _nearest_to_box(half: Vector, a: Vector, along: Vector) -> float:
    """Position on a segment, from 0 to 1, where its distance from a box is least.

    The derivative of the squared distance is piecewise linear and non-decreasing, so its zero lies between
    two neighbouring crossings of the segment with the planes of the faces.
    """
    low, high = 0.0, 1.0
    below, above = dot(_beyond(a, half), along), dot(_beyond(add(a, along), half), along)
    if below >= 0:
        return 0.0
    if above <= 0:
        return 1.0
    for k in range(6):
        face = half[k % 3] if k < 3 else -half[k % 3]
        if along[k % 3] == 0:
            continue
        s = (face - a[k % 3]) / along[k % 3]
        if low < s < high:
            slope = dot(_beyond(add(a, scale(s, along)), half), along)
            if slope < 0:
                low, below = s, slope
            elif slope > 0:
                high, above = s, slope
            else:
                return s
    return low + (high - low) * below / (below - above)
