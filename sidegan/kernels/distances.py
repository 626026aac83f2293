"""Signed distances of segments from each other and from keep-out regions, compiled."""

import math

from sidegan.kernels.chain import BALL, BOX, PLANE, Array, Shapes
from sidegan.kernels.formulas import Vector, add, dot, less, times
from sidegan.kernels.jit import inline, kernel
from sidegan.kernels.links import TOUCHING, nearest, row

_HALVINGS = 36  # of a capsule's axis at a box: leaves 1e-11 of its length
_STEPS = 60  # of the search along a segment at a convex body, which takes five
_SETTLED = 1e-12  # [m] between a bound from below and what is found


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
def _valley(half: Vector, a: Vector, along: Vector) -> tuple[float, float]:
    """Shares of a segment's length between which its distance from a box at the origin is least.

    The distance is convex along the segment, so halving finds it.
    """
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        if _slope(add(a, times(middle, along)), half, along) < 0:
            low = middle
        else:
            high = middle
    return low, high


@inline
def to_box(centre: Vector, half: Vector, a: Vector, b: Vector) -> float:
    """Signed distance [m] of a segment to a box."""
    a, b = less(a, centre), less(b, centre)
    along = less(b, a)
    low, high = _valley(half, a, along)
    before, after = add(a, times(low, along)), add(a, times(high, along))
    return min(point_to_box(before, half), point_to_box(after, half))


@inline
def to_ball(numbers: Array, r: int, a: Vector, b: Vector) -> float:
    """Signed distance [m] of a segment to a ball."""
    centre = row(numbers, r)
    distance = between_segments(a, b, centre, centre)
    return distance - numbers[r, 3]


@kernel
def _highest(planes: Array, first: int, last: int, x: Vector) -> int:
    """Which of some planes a point is highest above."""
    best, most = first, -math.inf
    for k in range(first, last):
        height = planes[k, 0] * x[0] + planes[k, 1] * x[1] + planes[k, 2] * x[2] - planes[k, 3]
        if height > most:
            best, most = k, height
    return best


@inline
def _height(planes: Array, k: int, x: Vector) -> float:
    return planes[k, 0] * x[0] + planes[k, 1] * x[1] + planes[k, 2] * x[2] - planes[k, 3]


@kernel
def lowest_crossing(
    planes: Array, first: int, last: int, a: Vector, b: Vector
) -> tuple[float, float, int, int, float]:
    """Where along a segment the height above the highest of some planes is least.

    The height [m], the share of the way from a to b, the two planes that cross there, and the second one's
    part in the slope of the height.
    """
    one, two = _highest(planes, first, last, a), _highest(planes, first, last, b)
    bound, share, part = -math.inf, 0.0, 0.0
    for _ in range(_STEPS):
        low, high = _height(planes, one, a), _height(planes, two, b)
        falls, rises = _height(planes, one, b) - low, high - _height(planes, two, a)
        if falls >= 0:
            return low, 0.0, one, two, 0.0
        if rises <= 0:
            return high, 1.0, one, two, 1.0
        share = min(max((low - (high - rises)) / (rises - falls), 0.0), 1.0)
        x = add(a, times(share, less(b, a)))
        top = _highest(planes, first, last, x)
        bound, part = low + falls * share, -falls / (rises - falls)
        if _height(planes, top, x) <= bound + _SETTLED:
            break
        if _height(planes, top, b) > _height(planes, top, a):
            two = top
        else:
            one = top
    return bound, share, one, two, part


@inline
def to_region(shapes: Shapes, r: int, a: Vector, b: Vector, middle: Vector, far: float) -> float:
    """Signed distance [m] of a segment to a region; infinite where its middle is surely ``far`` [m] away.

    Boxes and convex bodies are what is worth that test.
    """
    numbers, kind = shapes.regions, shapes.kinds[r]
    if kind == PLANE:
        return to_plane(numbers, r, a, b)
    if kind == BALL:
        return to_ball(numbers, r, a, b)
    centre = row(numbers, r)
    if kind == BOX:
        half = (numbers[r, 3], numbers[r, 4], numbers[r, 5])
        if point_to_box(less(middle, centre), half) >= far:
            return math.inf
        return to_box(centre, half, a, b)
    apart, reach = less(middle, centre), far + numbers[r, 3]
    if reach > 0 and dot(apart, apart) >= reach * reach:
        return math.inf
    first, last = int(numbers[r, 4]), int(numbers[r, 5])
    return lowest_crossing(shapes.planes, first, last, a, b)[0]


@inline
def outwards(x: Vector, half: Vector) -> Vector:
    """Unit direction in which the distance from a box at the origin grows fastest."""
    beyond = abs(x[0]) - half[0], abs(x[1]) - half[1], abs(x[2]) - half[2]
    farthest = max(beyond[0], beyond[1], beyond[2])
    if farthest > 0:
        n = max(beyond[0], 0.0), max(beyond[1], 0.0), max(beyond[2], 0.0)
    elif beyond[0] == farthest:
        n = 1.0, 0.0, 0.0
    elif beyond[1] == farthest:
        n = 0.0, 1.0, 0.0
    else:
        n = 0.0, 0.0, 1.0
    size = 1.0 / math.sqrt(dot(n, n))
    return (
        math.copysign(size * n[0], x[0]),
        math.copysign(size * n[1], x[1]),
        math.copysign(size * n[2], x[2]),
    )


@inline
def _steepness(x: Vector, half: Vector, along: Vector) -> float:
    """Half the growth of the squared distance from a box along a direction; zero inside of it."""
    total = 0.0
    for k in range(3):
        total += math.copysign(max(abs(x[k]) - half[k], 0.0), x[k]) * along[k]
    return total


@inline
def _nearest_outside(half: Vector, a: Vector, along: Vector) -> float:
    """Where on a segment its squared distance from a box is least, as a share of its length.

    The slope of the squared distance is piecewise linear and never falls: its zero lies between two of the
    places where the segment passes a plane of a face.
    """
    low, high = 0.0, 1.0
    below, above = _steepness(a, half, along), _steepness(add(a, along), half, along)
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
            slope = _steepness(add(a, times(s, along)), half, along)
            if slope < 0:
                low, below = s, slope
            elif slope > 0:
                high, above = s, slope
            else:
                return s
    return low + (high - low) * below / (below - above)


@inline
def nearest_to_box(half: Vector, a: Vector, b: Vector) -> tuple[float, float, float, float]:
    """Signed distance [m] of a segment from a box at the origin, and what its slope follows from.

    These are two shares of the segment's length and the weight of the first: where the segment pierces the
    box, the distance is least where two faces are equally near, and its slope is a mixture of theirs, with
    which it does not change along the segment.
    """
    along = less(b, a)
    s = _nearest_outside(half, a, along)
    distance = point_to_box(add(a, times(s, along)), half)
    if distance > TOUCHING:
        return distance, s, s, 1.0
    low, high = _valley(half, a, along)
    before, after = add(a, times(low, along)), add(a, times(high, along))
    fall = max(-dot(outwards(before, half), along), 0.0)
    rise = max(dot(outwards(after, half), along), 0.0)
    share = rise / max(fall + rise, 1e-300)
    return share * point_to_box(before, half) + (1.0 - share) * point_to_box(after, half), low, high, share
