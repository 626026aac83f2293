"""Compiled placement, distances and displacement bounds of an arm's capsules and the hulls inside them.

Branch and bound proves that two bodies never touch: boxes of positions are halved until each is clear.
"""

import math
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array
from sidegan.kernels.chain import Bodies, Chain, Shapes
from sidegan.kernels.distances import near_region, near_segment
from sidegan.kernels.formulas import (
    Matrix,
    Vector,
    add,
    cross,
    dot,
    less,
    matrix_product,
    scale,
    to_child,
    to_parent,
)
from sidegan.kernels.gjk import apart
from sidegan.kernels.jit import inline, kernel
from sidegan.kernels.links import joint, matrix, placement, row, set_matrix, set_row


class Pose(NamedTuple):
    """Pose of an arm, with scratch for a distance search; one per thread."""

    turn: Array  # rotations of the base and joint frames in the world, (J + 1, 9)
    place: Array  # their origins in the world [m], (J + 1, 3)
    own: Array  # rotations of the joint frames in their parents' frames, (J, 9)
    shift: Array  # their origins in their parents' frames [m], (J, 3)
    ends: Array  # end points and midpoints of the capsules' axes in the world [m], (3, C, 3)
    search: Array  # (6, 4), see ``gjk.apart``


def pose_for(shapes: Shapes, joints: int) -> Pose:
    """Empty pose of an arm whose base frame is the world frame."""
    sizes = (joints + 1, 9), (joints + 1, 3), (joints, 9), (joints, 3), (3, len(shapes.frame), 3), (6, 4)
    at = Pose(*map(np.zeros, sizes))
    at.turn[0] = np.eye(3).flatten()
    return at


@inline
def place_joints(chain: Chain, q: Array, at: Pose) -> None:
    """Write the joint frames at positions (J,)."""
    for i in range(len(q)):
        r, shift = placement(joint(chain, i), math.sin(q[i]), math.cos(q[i]), q[i])
        parent = matrix(at.turn, i)
        set_matrix(at.own, i, r)
        set_row(at.shift, i, shift)
        set_matrix(at.turn, i + 1, matrix_product(parent, r))
        set_row(at.place, i + 1, add(row(at.place, i), to_parent(parent, shift)))


@inline
def place_capsule(shapes: Shapes, c: int, at: Pose) -> None:
    """Write the end points and the midpoint of a capsule's axis in the world."""
    f = shapes.frame[c]
    turn, origin = matrix(at.turn, f), row(at.place, f)
    a = add(origin, to_parent(turn, row(shapes.ends[0], c)))
    b = add(origin, to_parent(turn, row(shapes.ends[1], c)))
    set_row(at.ends[0], c, a)
    set_row(at.ends[1], c, b)
    set_row(at.ends[2], c, scale(0.5, add(a, b)))


@inline
def inner_and_outer(shapes: Shapes, p: int) -> tuple[int, int, int, int]:
    """Inner and outer capsule of a pair, and their frames."""
    i, k = shapes.pairs[p, 0], shapes.pairs[p, 1]
    if shapes.frame[i] > shapes.frame[k]:
        i, k = k, i
    return i, k, shapes.frame[i], shapes.frame[k]


@inline
def near_pair(shapes: Shapes, ends: Array, p: int) -> tuple[float, Vector, Vector]:
    """Distance [m] of a pair's capsules plus its allowance, and the nearest points of their axes."""
    i, k = shapes.pairs[p, 0], shapes.pairs[p, 1]
    distance, one, two = near_segment(row(ends[0], i), row(ends[1], i), row(ends[0], k), row(ends[1], k))
    return distance - (shapes.radius[i] + shapes.radius[k]) + shapes.closer[p], one, two


@kernel
def signed_distances(chain: Chain, shapes: Shapes, q: Array, pairs: Array, regions: Array, at: Pose) -> None:
    """Write signed distances [m] of capsule pairs, (N, P), and of guarded capsules from regions, (N, K).

    Negative distances are overlaps. Positions [rad or m] are (N, J).
    """
    for n in range(len(q)):
        place_joints(chain, q[n], at)
        for c in range(len(shapes.frame)):
            place_capsule(shapes, c, at)
        for p in range(len(shapes.pairs)):
            pairs[n, p], _, _ = near_pair(shapes, at.ends, p)
        for k in range(len(shapes.guarded)):
            r, c = shapes.guarded[k, 0], shapes.guarded[k, 1]
            height, _, _ = near_region(shapes, r, row(at.ends[0], c), row(at.ends[1], c))
            regions[n, k] = height - shapes.outer[c]


@inline
def pair_direction(shapes: Shapes, ends: Array, p: int) -> Vector:
    """A direction from the second to the first of a pair's capsules."""
    _, one, two = near_pair(shapes, ends, p)
    gap = less(one, two)
    if dot(gap, gap) > 1e-12:
        return gap
    gap = less(row(ends[2], shapes.pairs[p, 0]), row(ends[2], shapes.pairs[p, 1]))
    return gap if dot(gap, gap) > 1e-12 else (0.0, 0.0, 1.0)


@inline
def _transposed(m: Matrix) -> Matrix:
    a, b, c = m
    return (a[0], b[0], c[0]), (a[1], b[1], c[1]), (a[2], b[2], c[2])


@kernel
def near_pieces(bodies: Bodies, at: Pose, p: int, need: float, known: Vector) -> float:
    """Lower bound on the distance [m] of the hulls in a pair's capsules, plus its allowance: ``gjk.apart``.

    The search starts along ``known``, a direction from the second to the first in the first capsule's frame,
    unless that is zero.
    """
    shapes = bodies.shapes
    i, k = shapes.pairs[p, 0], shapes.pairs[p, 1]
    f, g = shapes.frame[i], shapes.frame[k]
    own = matrix(at.turn, f)
    turn = matrix_product(_transposed(own), matrix(at.turn, g))
    place = to_child(own, less(row(at.place, g), row(at.place, f)))
    start = known
    if dot(known, known) == 0.0:
        start = to_child(own, pair_direction(shapes, at.ends, p))
    closer = shapes.closer[p]
    return apart(bodies.hulls, (i, k), turn, place, start, need - closer, at.search) + closer


@kernel
def distances(bodies: Bodies, q: Array, asked: Array, need: float, out: Array, at: Pose) -> None:
    """Write lower bounds on the distances [m] of hulls, (M,), at positions (N, J); see ``gjk.apart``.

    ``asked`` holds row of q and pair for each distance, (M, 2) int, sorted by row.
    """
    before = -1
    for m in range(len(asked)):
        n, p = asked[m, 0], asked[m, 1]
        if n != before:
            before = n
            place_joints(bodies.chain, q[n], at)
        place_capsule(bodies.shapes, bodies.shapes.pairs[p, 0], at)
        place_capsule(bodies.shapes, bodies.shapes.pairs[p, 1], at)
        out[m] = near_pieces(bodies, at, p, need, (0.0, 0.0, 0.0))


@inline
def _reached(bodies: Bodies, at: Pose, p: int, half: Array, reach: Array) -> float:
    """Largest displacement [m] of a pair's outer body against its inner one, for joint motions up to half.

    A point's distance from a joint axis changes only by the motion of joints further out. So the current
    lever arm plus that motion bounds the lever arm, and so does ``reach``, (P, J), its maximum over all
    positions.
    """
    chain = bodies.chain
    _, c, inner, outer = inner_and_outer(bodies.shapes, p)
    a, b, total = row(at.ends[0], c), row(at.ends[1], c), 0.0
    for j in range(outer - 1, inner - 1, -1):
        lever = reach[p, j]
        if not chain.prismatic[j]:
            axis, origin = to_parent(matrix(at.turn, j + 1), row(chain.axis, j)), row(at.place, j + 1)
            one, two = cross(axis, less(a, origin)), cross(axis, less(b, origin))
            now = math.sqrt(max(dot(one, one), dot(two, two)))
            lever = min(lever, now + bodies.hulls.around[c] + total)
        total += half[j] * lever
    return total


@kernel
def never_touch(
    bodies: Bodies, reach: Array, p: int, gap: float, boxes: Array, budget: int, at: Pose
) -> bool:
    """Whether pair p provably stays farther apart than a gap [m] at all positions, within a budget of boxes.

    ``reach`` is the largest lever arm of each joint for the pair's hulls, (P, J); ``boxes`` a stack of boxes
    of positions, centres and half widths, (2, D, J), the first of which holds all positions.
    """
    inner, outer, first, last = inner_and_outer(bodies.shapes, p)
    count = 1
    for _ in range(budget):
        count -= 1
        middle, half = boxes[0, count], boxes[1, count]
        place_joints(bodies.chain, middle, at)
        place_capsule(bodies.shapes, inner, at)
        place_capsule(bodies.shapes, outer, at)
        now, _, _ = near_pair(bodies.shapes, at.ends, p)
        moved = _reached(bodies, at, p, half, reach)
        if not now - moved > gap and bodies.hulls.finer[p]:
            now = max(now, near_pieces(bodies, at, p, moved + gap, (0.0, 0.0, 0.0)))
        if not now > gap:
            return False
        if not now - moved > gap:
            if count + 2 > boxes.shape[1]:
                return False
            _halve(boxes, count, reach[p], first, last)
            count += 2
        if count == 0:
            return True
    return False


@inline
def _halve(boxes: Array, at: int, reach: Array, first: int, last: int) -> None:
    """Halve a box along the joint that moves the bodies most; the halves go to ``at`` and ``at + 1``."""
    widest = first
    for j in range(first, last):
        if boxes[1, at, j] * reach[j] > boxes[1, at, widest] * reach[widest]:
            widest = j
    boxes[1, at, widest] /= 2
    for j in range(boxes.shape[2]):
        boxes[0, at + 1, j], boxes[1, at + 1, j] = boxes[0, at, j], boxes[1, at, j]
    boxes[0, at, widest] -= boxes[1, at, widest]
    boxes[0, at + 1, widest] += boxes[1, at, widest]
