"""The point of a simplex that is nearest to the origin, compiled. Source: Ericson 2005, section 5.1.9."""

import numpy as np

from sidegan.kernels.chain import Array
from sidegan.kernels.formulas import Vector, add, cross, dot, less, times
from sidegan.kernels.jit import inline, kernel
from sidegan.kernels.links import row, set_row

INSIDE = 5  # what stands for a tetrahedron that holds the origin


@inline
def _on_segment(a: Vector, b: Vector) -> float:
    """Share of b in the point of a segment that is nearest to the origin."""
    along = less(b, a)
    return min(max(-dot(a, along) / dot(along, along), 0.0), 1.0)


@kernel
def _on_triangle(a: Vector, b: Vector, c: Vector) -> tuple[float, float, float]:
    """Shares of the corners in the point of a triangle that is nearest to the origin."""
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
    """Whether the origin and d are on two sides of the plane through a, b and c."""
    normal = cross(less(b, a), less(c, a))
    return -dot(a, normal) * dot(less(d, a), normal) <= 0


@kernel
def _face(points: Array, i: int, j: int, k: int, best: float, weights: Array) -> float:
    """Take the face of a tetrahedron into account: the smaller squared distance, with its shares written."""
    a, b, c = row(points, i), row(points, j), row(points, k)
    s, t, u = _on_triangle(a, b, c)
    point = add(add(times(s, a), times(t, b)), times(u, c))
    size = dot(point, point)
    if size < best:
        weights[0] = weights[1] = weights[2] = weights[3] = 0.0
        weights[i], weights[j], weights[k] = s, t, u
        best = size
    return best


@kernel
def nearest_point(points: Array, count: int, weights: Array) -> int:
    """Shares of corners (4, 3) in the simplex' point nearest to the origin; corners without one are dropped.

    The number of corners left comes back; ``INSIDE`` when the origin is inside of a tetrahedron.
    """
    for i in range(4):
        weights[i] = 0.0
    if count == 1:
        weights[0] = 1.0
    elif count == 2:
        weights[1] = _on_segment(row(points, 0), row(points, 1))
        weights[0] = 1.0 - weights[1]
    elif count == 3:
        weights[0], weights[1], weights[2] = _on_triangle(row(points, 0), row(points, 1), row(points, 2))
    else:
        a, b, c, d = row(points, 0), row(points, 1), row(points, 2), row(points, 3)
        best = np.inf
        if _outside(a, b, c, d):
            best = _face(points, 0, 1, 2, best, weights)
        if _outside(a, b, d, c):
            best = _face(points, 0, 1, 3, best, weights)
        if _outside(a, c, d, b):
            best = _face(points, 0, 2, 3, best, weights)
        if _outside(b, c, d, a):
            best = _face(points, 1, 2, 3, best, weights)
        if best == np.inf:
            return INSIDE
    left = 0
    for i in range(count):
        if weights[i] > 0:
            weights[left] = weights[i]
            set_row(points, left, row(points, i))
            left += 1
    return left
