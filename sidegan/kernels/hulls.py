"""Distance of convex hulls, compiled: the algorithm of Gilbert, Johnson and Keerthi on links' own corners.

Every search direction gives a plane that lies between the two hulls, or shows that it does not: what comes
back is the best such plane's lower bound of the distance, so that an early end or rounding makes it smaller
and never too large. Sources: Gilbert, Johnson, Keerthi 1988; Ericson 2005, sections 5.1 and 9.5.
"""

import math
from typing import NamedTuple

import numpy as np

from sidegan.kernels.chain import Array, Chain, Shapes
from sidegan.kernels.formulas import Matrix, Vector, add, cross, dot, less, product, times, to_parent
from sidegan.kernels.jit import inline, kernel
from sidegan.kernels.links import (
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
from sidegan.kernels.simplex import INSIDE, nearest_point

_ROUNDS = 60  # of the search; five to ten are usual
_CLOSE = 1e-8  # [m] between the bounds of a distance that is known well enough
_TOUCHING = 1e-10  # [m] below it two hulls touch


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
def farthest(corners: Array, first: int, last: int, x: float, y: float, z: float) -> int:
    """The corner that lies farthest in a direction."""
    best, found = -np.inf, first
    for i in range(first, last):
        height = x * corners[i, 0] + y * corners[i, 1] + z * corners[i, 2]
        if height > best:
            best, found = height, i
    return found


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
        room: to work in, (6, 4); in its last row the direction, from the second to the first, that gave the
            bound stays behind.
    """
    i, k = pair
    points, weights, best = room[:4, :3], room[4], room[5]
    back = _transposed(turn)
    round_ = hulls.radius[i] + hulls.radius[k]
    v, bound, count = start, -np.inf, 0
    size = math.sqrt(dot(v, v))
    for _ in range(_ROUNDS):
        w = to_parent(back, v)
        one = farthest(hulls.corners, hulls.start[i], hulls.start[i + 1], -v[0], -v[1], -v[2])
        two = farthest(hulls.corners, hulls.start[k], hulls.start[k + 1], w[0], w[1], w[2])
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
        count = nearest_point(points, count + 1, weights)
        if count == INSIDE:
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
    """A direction from the second to the first of two capsules with these ends."""
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


class Bodies(NamedTuple):
    """Capsules on the links of an arm, and what is inside of them."""

    chain: Chain
    shapes: Shapes
    hulls: Hulls


class Placed(NamedTuple):
    """The same somewhere: the joints' frames, and the ends of the capsules' axes in the world, (3, C, 3)."""

    bodies: Bodies
    world: Frames
    ends: Array


@inline
def reached(at: Placed, p: int, moves: Array, reach: Array, beside: float) -> float:
    """How far at most joints that move so far move the second of a pair's bodies against the first [m].

    In the frame of a joint, a point's distance from its axis changes only as far as the joints further out
    move it there: the levers of now, and this motion, bound all levers.

    Args:
        at: where the arm is now.
        p: the pair.
        moves: how far each joint may go from its position at most [rad or m], (J,).
        reach: the largest lever that each joint has wherever the arm is, (P, J).
        beside: distance [m] from the capsule's axis within which the body is.
    """
    chain, shapes, world, ends = at.bodies.chain, at.bodies.shapes, at.world, at.ends
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
def between_pieces(at: Placed, p: int, need: float, room: Array, known: Vector) -> float:
    """The same for pair p of an arm somewhere; known is a direction to begin with, or zero."""
    shapes, world, ends = at.bodies.shapes, at.world, at.ends
    i, k = shapes.pairs[p, 0], shapes.pairs[p, 1]
    f, g = shapes.frame[i], shapes.frame[k]
    back = _transposed(matrix(world.turn, f))
    turn = product(back, matrix(world.turn, g))
    place = to_parent(back, less(row(world.place, g), row(world.place, f)))
    start = known
    if dot(known, known) == 0.0:
        gap = direction(row(ends[0], i), row(ends[1], i), row(ends[0], k), row(ends[1], k))
        start = to_parent(back, gap)
    return apart(at.bodies.hulls, (i, k), turn, place, start, need, room)


class Place(NamedTuple):
    """Room for an arm's frames and its capsules' ends, (3, C, 3), and for a search, (6, 4)."""

    world: Frames
    ends: Array
    search: Array


def place_for(shapes: Shapes, joints: int) -> Place:
    """Room to work in; not to be shared among threads."""
    return Place(frames(joints), np.zeros((3, len(shapes.frame), 3)), np.zeros((6, 4)))


@kernel
def put(bodies: Bodies, q: Array, room: Place) -> None:
    """Write the joints' frames at positions (J,)."""
    for i in range(len(q)):
        r, shift = placement(joint(bodies.chain, i), math.sin(q[i]), math.cos(q[i]), q[i])
        locate(room.world, i, r, shift)


@kernel
def put_pair(bodies: Bodies, p: int, room: Place) -> None:
    """Write the ends of a pair's capsules in the world."""
    shapes = bodies.shapes
    for c in (shapes.pairs[p, 0], shapes.pairs[p, 1]):
        f = shapes.frame[c]
        turn, origin = matrix(room.world.turn, f), row(room.world.place, f)
        for e in range(2):
            set_row(room.ends[e], c, add(origin, to_parent(turn, row(shapes.ends[e], c))))


@kernel
def distances(bodies: Bodies, q: Array, asked: Array, need: float, out: Array, room: Place) -> None:
    """Write lower bounds of distances [m] of pieces, (M,), at rows of positions (N, J); see ``apart``.

    Args:
        bodies: the arm's.
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
            put(bodies, q[n], room)
        put_pair(bodies, p, room)
        out[m] = between_pieces(Placed(bodies, room.world, room.ends), p, need, room.search, (0.0, 0.0, 0.0))
