"""Nearest points of segments to each other and to keep-out regions, and the directions away; compiled.

Prover, penalty and evaluation all ask these, and take what they need.
"""

import math

from sidegan.kernels.chain import BALL, BOX, PLANE, Array, Shapes
from sidegan.kernels.formulas import Vector, add, dot, less, times
from sidegan.kernels.jit import inline, kernel
from sidegan.kernels.links import TOUCHING, nearest, row

# Signed distance [m] of a segment from a region, and its slope in two points of the segment: a point, the
# direction away there, another point, the direction there. Only where a segment pierces a box, which it may
# leave along two faces at once, is the second one not zero.
Contact = tuple[float, Vector, Vector, Vector, Vector]

_HALVINGS = 36  # of a segment in a box: leaves 1e-11 of its length
_STEPS = 60  # of the search along a segment at a convex body, which takes five
_SETTLED = 1e-12  # [m] between a bound from below and what is found
_NOWHERE = (0.0, 0.0, 0.0)


@inline
def near_segment(a1: Vector, b1: Vector, a2: Vector, b2: Vector) -> tuple[float, Vector, Vector]:
    """Distance [m] between two segments, and their nearest points."""
    one, two = nearest(a1, b1, a2, b2)
    gap = less(one, two)
    distance = math.sqrt(dot(gap, gap))
    return TOUCHING if distance < TOUCHING else distance, one, two


@inline
def from_region(shapes: Shapes, r: int, x: Vector) -> float:
    """Distance [m] of a point from a region, or of a convex body from the ball around it."""
    numbers, kind = shapes.regions, shapes.kinds[r]
    if kind == PLANE:
        return dot(row(numbers, r), x) - numbers[r, 3]
    apart = less(x, row(numbers, r))
    if kind == BOX:
        return _from_box(apart, (numbers[r, 3], numbers[r, 4], numbers[r, 5]))
    return math.sqrt(dot(apart, apart)) - numbers[r, 3]


@kernel
def near_region(shapes: Shapes, r: int, a: Vector, b: Vector) -> Contact:
    """Where a segment is nearest to a region, or deepest in it."""
    numbers, kind, centre = shapes.regions, shapes.kinds[r], row(shapes.regions, r)
    if kind == PLANE:
        low, high = dot(centre, a), dot(centre, b)
        point = a if low < high else b
        return min(low, high) - numbers[r, 3], point, centre, point, _NOWHERE
    if kind == BALL:
        distance, point, _ = near_segment(a, b, centre, centre)
        away = times(1 / distance, less(point, centre))
        return distance - numbers[r, 3], point, away, point, _NOWHERE
    if kind == BOX:
        return _near_box(centre, (numbers[r, 3], numbers[r, 4], numbers[r, 5]), a, b)
    return _near_body(shapes.planes, int(numbers[r, 4]), int(numbers[r, 5]), a, b)


@inline
def _height(planes: Array, k: int, x: Vector) -> float:
    return planes[k, 0] * x[0] + planes[k, 1] * x[1] + planes[k, 2] * x[2] - planes[k, 3]


@kernel
def _highest(planes: Array, first: int, last: int, x: Vector) -> int:
    """Which of some planes a point is highest above."""
    best, most = first, -math.inf
    for k in range(first, last):
        height = _height(planes, k, x)
        if height > most:
            best, most = k, height
    return best


@inline
def _near_body(planes: Array, first: int, last: int, a: Vector, b: Vector) -> Contact:
    """The same for a convex body: where the height above the highest of its planes is least.

    Two planes cross there, unless it is an end of the segment; the way is away from both.
    """
    one, two = _highest(planes, first, last, a), _highest(planes, first, last, b)
    bound, share, part = -math.inf, 0.0, 0.0  # of the height; of the way from a to b; of the second plane
    for _ in range(_STEPS):
        low, high = _height(planes, one, a), _height(planes, two, b)
        falls, rises = _height(planes, one, b) - low, high - _height(planes, two, a)
        if falls >= 0:
            bound, share, part = low, 0.0, 0.0
            break
        if rises <= 0:
            bound, share, part = high, 1.0, 1.0
            break
        share = min(max((low - (high - rises)) / (rises - falls), 0.0), 1.0)
        bound, part = low + falls * share, -falls / (rises - falls)
        x = add(a, times(share, less(b, a)))
        top = _highest(planes, first, last, x)
        if _height(planes, top, x) <= bound + _SETTLED:
            break
        if _height(planes, top, b) > _height(planes, top, a):
            two = top
        else:
            one = top
    point = add(times(1 - share, a), times(share, b))
    away = add(times(1 - part, row(planes, one)), times(part, row(planes, two)))
    return bound, point, away, point, _NOWHERE


@inline
def _beyond(x: Vector, half: Vector) -> Vector:
    """Way to a point from the nearest one of a box at the origin; zero inside of it."""
    return (
        math.copysign(max(abs(x[0]) - half[0], 0.0), x[0]),
        math.copysign(max(abs(x[1]) - half[1], 0.0), x[1]),
        math.copysign(max(abs(x[2]) - half[2], 0.0), x[2]),
    )


@inline
def _from_box(x: Vector, half: Vector) -> float:
    """Signed distance [m] of a point from a box at the origin."""
    beyond = _beyond(x, half)
    depth = max(abs(x[0]) - half[0], abs(x[1]) - half[1], abs(x[2]) - half[2])
    return max(math.sqrt(dot(beyond, beyond)), TOUCHING) + min(depth, 0.0)


@inline
def _outwards(x: Vector, half: Vector) -> Vector:
    """Unit direction in which the distance from a box at the origin grows fastest."""
    beyond = _beyond(x, half)
    square = dot(beyond, beyond)
    if square > 0:
        return times(1.0 / math.sqrt(square), beyond)
    depth = abs(x[0]) - half[0], abs(x[1]) - half[1], abs(x[2]) - half[2]
    least = max(depth[0], depth[1], depth[2])
    if depth[0] == least:
        return math.copysign(1.0, x[0]), 0.0, 0.0
    if depth[1] == least:
        return 0.0, math.copysign(1.0, x[1]), 0.0
    return 0.0, 0.0, math.copysign(1.0, x[2])


@inline
def _near_box(centre: Vector, half: Vector, a: Vector, b: Vector) -> Contact:
    """The same for a box; where it is pierced, the slope is a mixture that is level along the segment."""
    a, b = less(a, centre), less(b, centre)
    along = less(b, a)
    nearest_ = add(a, times(_nearest_outside(half, a, along), along))
    distance, point = _from_box(nearest_, half), add(nearest_, centre)
    if distance > TOUCHING:
        return distance, point, _outwards(nearest_, half), point, _NOWHERE
    low, high = _valley(half, a, along)
    one, two = add(a, times(low, along)), add(a, times(high, along))
    before, after = _outwards(one, half), _outwards(two, half)
    fall, rise = max(-dot(before, along), 0.0), max(dot(after, along), 0.0)
    share = rise / max(fall + rise, 1e-300)
    distance = share * _from_box(one, half) + (1.0 - share) * _from_box(two, half)
    return distance, add(one, centre), times(share, before), add(two, centre), times(1.0 - share, after)


@inline
def _nearest_outside(half: Vector, a: Vector, along: Vector) -> float:
    """Where on a segment its squared distance from a box is least, as a share of its length.

    The slope of the squared distance is piecewise linear and never falls: its zero lies between two of the
    places where the segment passes a plane of a face.
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
            slope = dot(_beyond(add(a, times(s, along)), half), along)
            if slope < 0:
                low, below = s, slope
            elif slope > 0:
                high, above = s, slope
            else:
                return s
    return low + (high - low) * below / (below - above)


@inline
def _valley(half: Vector, a: Vector, along: Vector) -> tuple[float, float]:
    """Shares of a segment's length between which its signed distance from a box, a convex one, is least."""
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        if dot(_outwards(add(a, times(middle, along)), half), along) < 0:
            low = middle
        else:
            high = middle
    return low, high
