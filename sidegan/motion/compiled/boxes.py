"""Proof that two bodies of an arm cannot touch, compiled: boxes of joint positions, halved until each is clear."""

import math

from sidegan.motion.compiled.chain import Array, Chain, Shapes
from sidegan.motion.compiled.distances import between_segments
from sidegan.motion.compiled.formulas import add, to_parent
from sidegan.motion.compiled.hulls import Hulls, Place, between_pieces, outer_of, reached
from sidegan.motion.compiled.jit import kernel
from sidegan.motion.compiled.links import joint, locate, matrix, placement, row, set_row


@kernel
def _place(chain: Chain, shapes: Shapes, q: Array, p: int, room: Place) -> None:
    """Frames of an arm at positions (J,), and the ends of a pair's capsules."""
    for i in range(len(q)):
        r, shift = placement(joint(chain, i), math.sin(q[i]), math.cos(q[i]), q[i])
        locate(room.world, i, r, shift)
    for c in (shapes.pairs[p, 0], shapes.pairs[p, 1]):
        f = shapes.frame[c]
        turn, origin = matrix(room.world.turn, f), row(room.world.place, f)
        for e in range(2):
            set_row(room.ends[e], c, add(origin, to_parent(turn, row(shapes.ends[e], c))))


@kernel
def _room_left(
    chain: Chain, shapes: Shapes, hulls: Hulls, reach: Array, half: Array, p: int, gap: float, room: Place
) -> tuple[float, float]:
    """Distance of a pair now [m], and what is left of it at least wherever joints go that move at most so far."""
    i, k, ends = shapes.pairs[p, 0], shapes.pairs[p, 1], room.ends
    apart = between_segments(row(ends[0], i), row(ends[1], i), row(ends[0], k), row(ends[1], k))
    apart -= shapes.radius[i] + shapes.radius[k]
    beside = hulls.around[outer_of(shapes, p)]
    moved = reached(chain, shapes, room.world, ends, p, half, reach, beside)
    if apart - moved > gap or not hulls.finer[p]:
        return apart, apart - moved
    inner = between_pieces(hulls, shapes, room.world, ends, p, moved + gap, room.search)
    return max(apart, inner), max(apart, inner) - moved


@kernel
def never_touch(
    chain: Chain,
    shapes: Shapes,
    hulls: Hulls,
    reach: Array,
    p: int,
    gap: float,
    boxes: Array,
    budget: int,
    room: Place,
) -> bool:
    """Whether a pair is proven to stay farther apart than a gap [m] wherever the joints are.

    Args:
        chain: the arm's joints.
        shapes: its capsules and their pairs.
        hulls: what is inside of these.
        reach: the largest lever that each joint has for what is inside, (P, J).
        p: the pair.
        gap: distance that has to be left.
        boxes: room for middles and halves of boxes of positions, (2, D, J); the first is the whole.
        budget: boxes that are looked at before giving up.
        room: to work in.
    """
    i, k = shapes.frame[shapes.pairs[p, 0]], shapes.frame[shapes.pairs[p, 1]]
    first, last, count = min(i, k), max(i, k), 1
    for _ in range(budget):
        count -= 1
        middle, half = boxes[0, count], boxes[1, count]
        _place(chain, shapes, middle, p, room)
        apart, left = _room_left(chain, shapes, hulls, reach, half, p, gap, room)
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
