"""Proof that two bodies of an arm cannot touch, compiled: boxes of positions, halved until each is clear."""

from sidegan.kernels.chain import Array
from sidegan.kernels.distances import between_segments
from sidegan.kernels.hulls import (
    Bodies,
    Place,
    Placed,
    between_pieces,
    outer_of,
    put,
    put_pair,
    reached,
)
from sidegan.kernels.jit import kernel
from sidegan.kernels.links import row


@kernel
def _room_left(
    bodies: Bodies, reach: Array, half: Array, p: int, gap: float, room: Place
) -> tuple[float, float]:
    """Distance of a pair now [m], and what is left of it at least while joints move at most so far, (J,)."""
    shapes, hulls, at = bodies.shapes, bodies.hulls, Placed(bodies, room.world, room.ends)
    i, k, ends = shapes.pairs[p, 0], shapes.pairs[p, 1], room.ends
    apart = between_segments(row(ends[0], i), row(ends[1], i), row(ends[0], k), row(ends[1], k))
    apart -= shapes.radius[i] + shapes.radius[k]
    beside = hulls.around[outer_of(shapes, p)]
    moved = reached(at, p, half, reach, beside)
    if apart - moved > gap or not hulls.finer[p]:
        return apart, apart - moved
    inner = between_pieces(at, p, moved + gap, room.search, (0.0, 0.0, 0.0))
    return max(apart, inner), max(apart, inner) - moved


@kernel
def never_touch(
    bodies: Bodies, reach: Array, p: int, gap: float, boxes: Array, budget: int, room: Place
) -> bool:
    """Whether a pair is proven to stay farther apart than a gap [m] wherever the joints are.

    Args:
        bodies: the arm's.
        reach: the largest lever that each joint has for what is inside, (P, J).
        p: the pair.
        gap: distance that has to be left.
        boxes: room for middles and halves of boxes of positions, (2, D, J); the first is the whole.
        budget: boxes that are looked at before giving up.
        room: to work in.
    """
    shapes = bodies.shapes
    i, k = shapes.frame[shapes.pairs[p, 0]], shapes.frame[shapes.pairs[p, 1]]
    first, last, count = min(i, k), max(i, k), 1
    for _ in range(budget):
        count -= 1
        middle, half = boxes[0, count], boxes[1, count]
        put(bodies, middle, room)
        put_pair(bodies, p, room)
        apart, left = _room_left(bodies, reach, half, p, gap, room)
        if not apart > gap:
            return False
        if not left > gap:
            widest = first
            for j in range(first, last):
                if half[j] * reach[p, j] > half[widest] * reach[p, widest]:
                    widest = j
            if count + 2 > boxes.shape[1]:
                return False
            half[widest] /= 2
            for j in range(boxes.shape[2]):
                boxes[0, count + 1, j], boxes[1, count + 1, j] = middle[j], half[j]
            middle[widest] -= half[widest]
            boxes[0, count + 1, widest] += half[widest]
            count += 2
        if count == 0:
            return True
    return False
