"""Compiled penalty of one trajectory for capsules that come too close to each other or to a region.

Many times of the trajectory are looked at at once: where everything is far apart, which is nearly everywhere,
that is found out by vector instructions.
"""

from typing import NamedTuple

from sidegan.kernels.chain import BOX, Array, Chain, Shapes
from sidegan.kernels.closeness import Span, from_region, pull_of_pair, pull_of_region
from sidegan.kernels.dynamics import (
    COS,
    LANES,
    SIN,
    Block,
    Lanes,
    Q,
    aligned,
    load,
    load_turn,
    step_of,
    store,
)
from sidegan.kernels.formulas import Vector, add, cross, dot, less, product, times, to_parent
from sidegan.kernels.jit import kernel
from sidegan.kernels.links import Joint, joint, placement, row

PLACE, AXIS, _FRAME = 9, 12, 15  # rows of a frame: rotation, origin, the joint's axis in the world
A, B, MIDDLE, _ENDS = 0, 3, 6, 9  # rows of a capsule: the ends of its axis, and the middle between them


class Room(NamedTuple):
    """Room for the kernel at work: rows of lanes."""

    world: Array  # frames of the base and the joints, (J + 1, _FRAME · LANES)
    ends: Array  # capsules, (C, _ENDS · LANES)
    gap: Array  # (LANES,)


def room(capsules: int, joints: int) -> Room:
    """Room to work in; not to be shared among threads."""
    return Room(aligned(joints + 1, _FRAME * LANES), aligned(capsules, _ENDS * LANES), aligned(1, LANES)[0])


@kernel
def _place(j: Joint, state: Array, block: Block, base: Lanes, frame: Lanes) -> None:
    """Write a joint's frame in the world, at many times, from its parent's."""
    i, start, count = block
    for n in range(min(count, LANES)):
        at = start + n
        r, shift = placement(j, state[SIN, 0, i, at], state[COS, 0, i, at], state[Q, 0, i, at])
        turn = load_turn(base, n)
        world = product(turn, r)
        store(frame, 0, n, world[0])
        store(frame, 3, n, world[1])
        store(frame, 6, n, world[2])
        store(frame, PLACE, n, add(load(base, PLACE, n), to_parent(turn, shift)))
        store(frame, AXIS, n, to_parent(world, j.axis))


@kernel
def _place_capsule(shapes: Shapes, k: int, frame: Lanes, ends: Lanes, count: int) -> None:
    """Write a capsule's ends in the world, at many times."""
    one, two = row(shapes.ends[0], k), row(shapes.ends[1], k)
    for n in range(min(count, LANES)):
        turn, place = load_turn(frame, n), load(frame, PLACE, n)
        a, b = add(place, to_parent(turn, one)), add(place, to_parent(turn, two))
        store(ends, A, n, a)
        store(ends, B, n, b)
        store(ends, MIDDLE, n, times(0.5, add(a, b)))


@kernel
def _push(chain: Chain, work: Room, at: Block, point: Vector, force: Vector, push: Array) -> None:
    """Add the slope in the positions, (J, S), of what has the slope ``force`` in a point of a link."""
    frame, start, n = at
    for j in range(frame):
        link = work.world[j + 1]
        axis = load(link, AXIS, n)
        if chain.prismatic[j]:
            push[j, start + n] += dot(axis, force)
        else:
            push[j, start + n] += dot(cross(axis, less(point, load(link, PLACE, n))), force)


@kernel
def _pairs(chain: Chain, shapes: Shapes, span: Span, reach: float, push: Array, work: Room) -> float:
    """What pairs cost in a block of times."""
    start, count = span
    total, gap = 0.0, work.gap
    for p in range(len(shapes.pairs)):
        i, k = shapes.pairs[p, 0], shapes.pairs[p, 1]
        one, two = work.ends[i], work.ends[k]
        for n in range(min(count, LANES)):
            apart = less(load(one, MIDDLE, n), load(two, MIDDLE, n))
            gap[n] = dot(apart, apart)
        far = (reach + shapes.size[i] + shapes.size[k]) ** 2
        for n in range(count):
            if gap[n] < far:
                axes = (load(one, A, n), load(one, B, n)), (load(two, A, n), load(two, B, n))
                excess, a, b, force = pull_of_pair(shapes, (i, k), reach, axes[0], axes[1])
                if excess > 0:
                    total += excess * excess
                    _push(chain, work, (shapes.frame[i], start, n), a, force, push)
                    _push(chain, work, (shapes.frame[k], start, n), b, times(-1.0, force), push)
    return total


@kernel
def _regions(chain: Chain, shapes: Shapes, span: Span, reach: float, push: Array, work: Room) -> float:
    """What regions cost in a block of times."""
    (start, count), total, gap = span, 0.0, work.gap
    for g in range(len(shapes.guarded)):
        r, k = shapes.guarded[g, 0], shapes.guarded[g, 1]
        ends, far = work.ends[k], reach + shapes.size[k]
        for n in range(min(count, LANES)):
            gap[n] = from_region(shapes, r, load(ends, MIDDLE, n))
        for n in range(count):
            if gap[n] < far:
                a, b = load(ends, A, n), load(ends, B, n)
                excess, one, force, two, other = pull_of_region(shapes, (r, k), reach, a, b)
                if excess > 0:
                    total += excess * excess
                    _push(chain, work, (shapes.frame[k], start, n), one, force, push)
                    if shapes.kinds[r] == BOX:
                        _push(chain, work, (shapes.frame[k], start, n), two, other, push)
    return total


@kernel
def stand(work: Room) -> None:
    """Put the base where it stands."""
    base = work.world[0]
    for n in range(LANES):
        for m in range(3):
            for k in range(3):
                base[(3 * m + k) * LANES + n] = 1.0 if m == k else 0.0
            base[(PLACE + m) * LANES + n] = 0.0


@kernel
def place(chain: Chain, shapes: Shapes, states: Array, span: Span, work: Room) -> None:
    """Write frames and capsules in the world in a block of times."""
    start, count = span
    for i in range(states.shape[2]):
        _place(joint(chain, i), states, (i, start, count), work.world[i], work.world[i + 1])
    for k in range(len(shapes.frame)):
        _place_capsule(shapes, k, work.world[shapes.frame[k]], work.ends[k], count)


@kernel
def keep_apart(
    chain: Chain, shapes: Shapes, states: Array, weight: float, reach: float, push: Array, work: Room
) -> float:
    """Weight times the squares of how far distances fall below ``reach`` [m], summed over time.

    States are (5, 1, J, S); the slopes in positions are added to push, (2, 1, J, S).
    """
    if weight == 0 or len(shapes.pairs) + len(shapes.guarded) == 0:
        return 0.0
    joints, samples, total = states.shape[2], states.shape[3], 0.0
    step, slope = step_of(samples), push[0, 0]
    for j in range(joints):  # the weight is that of the sum: what is there already waits
        for n in range(samples):
            slope[j, n] /= weight
    stand(work)
    for start in range(0, samples, step):
        span = start, min(step, samples - start)
        place(chain, shapes, states, span, work)
        total += _pairs(chain, shapes, span, reach, slope, work)
        total += _regions(chain, shapes, span, reach, slope, work)
    for j in range(joints):
        for n in range(samples):
            slope[j, n] *= weight
    return weight * total
