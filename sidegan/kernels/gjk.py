"""Compiled distance of convex hulls by the algorithm of Gilbert, Johnson and Keerthi.

Every search direction gives a lower bound on the distance, the gap between two supporting planes. The best
bound is returned, so early termination and rounding can make the result too small but never too large.
Sources: Gilbert, Johnson, Keerthi 1988; Ericson 2005, sections 5.1 and 9.5.
"""

import math

import numpy as np

from sidegan.base.arrays import Array
from sidegan.kernels.chain import Hulls
from sidegan.kernels.formulas import Matrix, Vector, add, cross, dot, less, scale, to_child, to_parent
from sidegan.kernels.jit import inline, kernel
from sidegan.kernels.links import row, set_row

_ROUNDS = 60  # of the search; five to ten are usual
_CLOSE = 1e-8  # [m] gap between upper and lower bound at convergence
_TOUCHING = 1e-10  # [m] hulls closer than this count as touching
_INSIDE = 5  # returned when a tetrahedron contains the origin


@kernel
def farthest(corners: Array, first: int, last: int, towards: Vector) -> int:
    """Index of the corner farthest in a direction (support point)."""
    best, found = -np.inf, first
    for i in range(first, last):
        height = dot(towards, row(corners, i))
        if height > best:
            best, found = height, i
    return found


@kernel
def apart(
    hulls: Hulls, pair: tuple[int, int], turn: Matrix, place: Vector, start: Vector, need: float, room: Array
) -> float:
    """Lower bound on the distance [m] of two enlarged hulls; minus infinity where the hulls touch.

    Args:
        hulls: all hulls.
        pair: indices of the two.
        turn: rotation of the second hull's frame in the first one's, (3, 3).
        place: origin of the second hull's frame in the first one's [m].
        start: initial direction from the second to the first, of any nonzero length.
        need: bound at which the search may stop.
        room: scratch, (6, 4); its last row receives the direction, from the second to the first, that gave
            the bound.
    """
    i, k = pair
    points, weights, best = room[:4, :3], room[4], room[5]
    round_ = hulls.radius[i] + hulls.radius[k]
    v, bound, count = start, -np.inf, 0
    size = math.sqrt(dot(v, v))
    for _ in range(_ROUNDS):
        one = farthest(hulls.corners, hulls.start[i], hulls.start[i + 1], scale(-1.0, v))
        two = farthest(hulls.corners, hulls.start[k], hulls.start[k + 1], to_child(turn, v))
        new = less(row(hulls.corners, one), add(place, to_parent(turn, row(hulls.corners, two))))
        here = dot(v, new) / size - round_
        if here > bound:
            bound = here
            best[0], best[1], best[2] = v
        if bound >= need or (count > 0 and size - (bound + round_) <= _CLOSE):
            return bound
        for n in range(count):
            same = less(row(points, n), new)
            if dot(same, same) == 0.0:
                return bound
        set_row(points, count, new)
        count = _nearest_point(points, count + 1, weights)
        if count == _INSIDE:
            return -np.inf
        old, v = size, (0.0, 0.0, 0.0)
        for n in range(count):
            v = add(v, scale(weights[n], row(points, n)))
        size = math.sqrt(dot(v, v))
        if not size > _TOUCHING:
            return -np.inf
        if count > 1 and size >= old and bound + round_ > 0:
            return bound
    return bound


@kernel
def _on_triangle(a: Vector, b: Vector, c: Vector) -> tuple[float, float, float]:
    """Barycentric coordinates of the point of a triangle nearest to the origin."""
    ab, ac = less(b, a), less(c, a)
    d1, d2 = -dot(ab, a), -dot(ac, a)
    if d1 <= 0 and d2 <= 0:
        return 1.0, 0.0, 0.0
    d3, d4 = -dot(ab, b), -dot(ac, b)
    if d3 >= 0 and d4 <= d3:
        return 0.0, 1.0, 0.0
    vc = d1 * d4 - d3 * d2
    if vc <= 0 and d1 >= 0 and d3 <= 0:
        v = d1 / (d1 - d3)
        return 1.0 - v, v, 0.0
    d5, d6 = -dot(ab, c), -dot(ac, c)
    if d6 >= 0 and d5 <= d6:
        return 0.0, 0.0, 1.0
    vb = d5 * d2 - d1 * d6
    if vb <= 0 and d2 >= 0 and d6 <= 0:
        w = d2 / (d2 - d6)
        return 1.0 - w, 0.0, w
    va = d3 * d6 - d5 * d4
    if va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 0.0, 1.0 - w, w
    whole = va + vb + vc
    return va / whole, vb / whole, vc / whole


@inline
def _outside(a: Vector, b: Vector, c: Vector, d: Vector) -> bool:
    """Whether the plane through a, b and c separates the origin from d."""
    normal = cross(less(b, a), less(c, a))
    return -dot(a, normal) * dot(less(d, a), normal) <= 0


@kernel
def _face(points: Array, corners: tuple[int, int, int], best: float, weights: Array) -> float:
    """Smaller of ``best`` and a face's squared distance; writes the face's weights if it is nearer."""
    i, j, k = corners
    a, b, c = row(points, i), row(points, j), row(points, k)
    s, t, u = _on_triangle(a, b, c)
    point = add(add(scale(s, a), scale(t, b)), scale(u, c))
    size = dot(point, point)
    if size < best:
        weights[0] = weights[1] = weights[2] = weights[3] = 0.0
        weights[i], weights[j], weights[k] = s, t, u
        best = size
    return best


@kernel
def _nearest_point(points: Array, count: int, weights: Array) -> int:
    """Reduce a simplex (4, 3) to the corners that span its point nearest to the origin; writes their weights.

    Returns the number of corners left, or ``_INSIDE`` if the origin is inside a tetrahedron.
    """
    if count == 1:
        weights[0] = 1.0
    elif count == 2:
        along = less(row(points, 1), row(points, 0))
        weights[1] = min(max(-dot(row(points, 0), along) / dot(along, along), 0.0), 1.0)
        weights[0] = 1.0 - weights[1]
    elif count == 3:
        _face(points, (0, 1, 2), np.inf, weights)
    else:
        best = np.inf
        for other in range(3, -1, -1):
            i, j, k = (other + 1) % 4, (other + 2) % 4, (other + 3) % 4
            if _outside(row(points, i), row(points, j), row(points, k), row(points, other)):
                best = _face(points, (i, j, k), best, weights)
        if best == np.inf:
            return _INSIDE
    left = 0
    for i in range(count):
        if weights[i] > 0:
            weights[left] = weights[i]
            set_row(points, left, row(points, i))
            left += 1
    return left
