"""Distance of convex hulls, compiled: the algorithm of Gilbert, Johnson and Keerthi on links' own corners.

Every search direction gives a plane that lies between the two hulls, or shows that it does not: what comes
back is the best such plane's lower bound of the distance, so that an early end or rounding makes it smaller
and never too large. Sources: Gilbert, Johnson, Keerthi 1988; Ericson 2005, sections 5.1 and 9.5.
"""

import math
from typing import NamedTuple

import numpy as np

from sidegan.motion.compiled.chain import Array, Chain, Shapes
from sidegan.motion.compiled.formulas import Matrix, Vector, add, cross, dot, less, product, times, to_parent
from sidegan.motion.compiled.jit import inline, kernel
from sidegan.motion.compiled.links import (
    Frames,
    frames,
    joint,
    locate,
    matrix,
    nearest,
    placement,
    row,
    set_row,
)

_ROUNDS = 60  # of the search; five to ten are usual
_CLOSE = 1e-8  # [m] between the bounds of a distance that is known well enough
_TOUCHING = 1e-10  # [m] below it two hulls touch

Weights = tuple[float, float, float, float]


class Hulls(NamedTuple):
    """What is inside of C capsules, each the hull of some corners with a ball around each of its points."""

    corners: Array  # in the frames of the capsules [m], (V, 3)
    start: Array  # where those of each begin, (C + 1,) int
    radius: Array  # of the balls [m], (C,)
    around: Array  # how far the corners are from the capsule's axis at most [m], (C,)
    finer: Array  # whether a pair of hulls may be farther apart than its capsules, (P,) bool

    @classmethod
    def none(cls, capsules: int, pairs: int) -> "Hulls":
        """Nothing but the capsules themselves."""
        zeros = np.zeros(capsules)
        starts, finer = np.zeros(capsules + 1, dtype=np.int64), np.zeros(pairs, dtype=bool)
        return cls(np.zeros((0, 3)), starts, zeros, zeros, finer)


@inline
def _transposed(m: Matrix) -> Matrix:
    a, b, c = m
    return (a[0], b[0], c[0]), (a[1], b[1], c[1]), (a[2], b[2], c[2])


@kernel
def _farthest(corners: Array, first: int, last: int, x: float, y: float, z: float) -> int:
    """The corner that lies farthest in a direction."""
    best, found = -np.inf, first
    for i in range(first, last):
        height = x * corners[i, 0] + y * corners[i, 1] + z * corners[i, 2]
        if height > best:
            best, found = height, i
    return found


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
    u, v = less(b, a), less(c, a)
    normal = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
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
def _reduce(points: Array, count: int, weights: Array) -> int:
    """Shares of corners (4, 3) in the simplex' point nearest to the origin; corners without one are dropped.

    The number of corners left comes back; 5 when the origin is inside of a tetrahedron.
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
            return 5
    left = 0
    for i in range(count):
        if weights[i] > 0:
            weights[left] = weights[i]
            set_row(points, left, row(points, i))
            left += 1
    return left


@kernel
def apart(
    hulls: Hulls, pair: tuple[int, int], turn: Matrix, place: Vector, start: Vector, need: float, room: Array
) -> float:
    """Lower bound of the distance [m] of two pieces; minus infinity where their hulls touch.

    Args:
        hulls: all pieces.
        pair: which two.
        turn: rotation of the second one's frame in the first one's, (3, 3).
        place: its origin there [m].
        start: a direction from the second to the first, of any length above zero.
        need: bound that is enough: where it is reached, the search ends.
        room: to work in, (5, 4).
    """
    i, k = pair
    points, weights = room[:4, :3], room[4]
    back = _transposed(turn)
    round_ = hulls.radius[i] + hulls.radius[k]
    v, bound, count = start, -np.inf, 0
    size = math.sqrt(dot(v, v))
    for _ in range(_ROUNDS):
        w = to_parent(back, v)
        one = _farthest(hulls.corners, hulls.start[i], hulls.start[i + 1], -v[0], -v[1], -v[2])
        two = _farthest(hulls.corners, hulls.start[k], hulls.start[k + 1], w[0], w[1], w[2])
        new = less(row(hulls.corners, one), add(place, to_parent(turn, row(hulls.corners, two))))
        bound = max(bound, dot(v, new) / size - round_)
        if bound >= need or (count > 0 and size - (bound + round_) <= _CLOSE):
            return bound
        for n in range(count):
            same = less(row(points, n), new)
            if dot(same, same) == 0.0:
                return bound
        set_row(points, count, new)
        count = _reduce(points, count + 1, weights)
        if count == 5:
            return -np.inf
        old, v = size, (0.0, 0.0, 0.0)
        for n in range(count):
            v = add(v, times(weights[n], row(points, n)))
        size = math.sqrt(dot(v, v))
        if not size > _TOUCHING:
            return -np.inf
        if count > 1 and size >= old and bound + round_ > 0:
            return bound
    return bound


@inline
def direction(a1: Vector, b1: Vector, a2: Vector, b2: Vector) -> Vector:
    """A direction from the second to the first of two capsules with these ends: between their nearest points."""
    one, two = nearest(a1, b1, a2, b2)
    gap = less(one, two)
    if dot(gap, gap) > 1e-12:
        return gap
    gap = less(add(a1, b1), add(a2, b2))
    return gap if dot(gap, gap) > 1e-12 else (0.0, 0.0, 1.0)


@inline
def _lever(axis: Vector, origin: Vector, a: Vector, b: Vector) -> float:
    """Largest distance [m] of a segment's points from a line through a point."""
    one, two = cross(axis, less(a, origin)), cross(axis, less(b, origin))
    return math.sqrt(max(dot(one, one), dot(two, two)))


@inline
def reached(
    chain: Chain, shapes: Shapes, world: Frames, ends: Array, p: int, moves: Array, reach: Array, beside: float
) -> float:
    """How far at most joints that move so far move the second of a pair's bodies against the first [m].

    In the frame of a joint, a point's distance from its axis changes only as far as the joints further out
    move it there: the levers of now, and this motion, bound all levers.

    Args:
        chain: the arm's joints.
        shapes: its capsules and their pairs.
        world: its frames now.
        ends: the capsules' ends in the world now, (3, C, 3).
        p: the pair.
        moves: how far each joint may go from its position at most [rad or m], (J,).
        reach: the largest lever that each joint has wherever the arm is, (P, J).
        beside: distance [m] from the capsule's axis within which the body is.
    """
    i, k = shapes.pairs[p, 0], shapes.pairs[p, 1]
    inner, outer = shapes.frame[i], shapes.frame[k]
    c = k
    if inner > outer:
        inner, outer, c = outer, inner, i
    a, b = row(ends[0], c), row(ends[1], c)
    total = 0.0
    for j in range(outer - 1, inner - 1, -1):
        lever = reach[p, j]
        if not chain.prismatic[j]:
            axis = to_parent(matrix(world.turn, j + 1), row(chain.axis, j))
            lever = min(lever, _lever(axis, row(world.place, j + 1), a, b) + beside + total)
        total += moves[j] * lever
    return total


@inline
def outer_of(shapes: Shapes, p: int) -> int:
    """The capsule of a pair that is further out."""
    i, k = shapes.pairs[p, 0], shapes.pairs[p, 1]
    return i if shapes.frame[i] > shapes.frame[k] else k


@inline
def between_pieces(
    hulls: Hulls, shapes: Shapes, world: Frames, ends: Array, p: int, need: float, room: Array
) -> float:
    """The same for pair p of an arm whose frames and capsules' ends (3, C, 3) are placed in the world."""
    i, k = shapes.pairs[p, 0], shapes.pairs[p, 1]
    f, g = shapes.frame[i], shapes.frame[k]
    back = _transposed(matrix(world.turn, f))
    turn = product(back, matrix(world.turn, g))
    place = to_parent(back, less(row(world.place, g), row(world.place, f)))
    start = to_parent(back, direction(row(ends[0], i), row(ends[1], i), row(ends[0], k), row(ends[1], k)))
    return apart(hulls, (i, k), turn, place, start, need, room)


class Place(NamedTuple):
    """Room for an arm's frames and its capsules' ends, (3, C, 3), and for a search, (5, 4)."""

    world: Frames
    ends: Array
    search: Array


def place_for(shapes: Shapes, joints: int) -> Place:
    """Room to work in; not to be shared among threads."""
    return Place(frames(joints), np.zeros((3, len(shapes.frame), 3)), np.zeros((5, 4)))


@kernel
def distances(
    chain: Chain, shapes: Shapes, hulls: Hulls, q: Array, asked: Array, need: float, out: Array, room: Place
) -> None:
    """Write lower bounds of distances [m] of pieces, (M,), at rows of positions (N, J); see ``apart``.

    Args:
        chain: the arm's joints.
        shapes: its capsules and their pairs.
        hulls: what is inside of these.
        q: positions [rad or m].
        asked: row and pair of each question, (M, 2) int, sorted by row.
        need: bound that is enough.
        out: what is written.
        room: to work in.
    """
    before = -1
    for m in range(len(asked)):
        n, p = asked[m, 0], asked[m, 1]
        if n != before:
            before = n
            for i in range(q.shape[1]):
                x = q[n, i]
                r, shift = placement(joint(chain, i), math.sin(x), math.cos(x), x)
                locate(room.world, i, r, shift)
        for c in (shapes.pairs[p, 0], shapes.pairs[p, 1]):
            f = shapes.frame[c]
            turn, origin = matrix(room.world.turn, f), row(room.world.place, f)
            for e in range(2):
                set_row(room.ends[e], c, add(origin, to_parent(turn, row(shapes.ends[e], c))))
        out[m] = between_pieces(hulls, shapes, room.world, room.ends, p, need, room.search)
