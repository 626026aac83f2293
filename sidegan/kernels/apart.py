"""Compiled penalty of one trajectory for capsules that come too close to each other or to a region.

Vectorised tests over blocks of samples rule out pairs that are far apart, as most are most of the time.
"""

from typing import NamedTuple

from sidegan.base.arrays import Array
from sidegan.kernels.chain import Chain, Shapes
from sidegan.kernels.distances import from_region, near_region, near_segment
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
from sidegan.kernels.formulas import Vector, add, cross, dot, less, matrix_product, scale, to_parent
from sidegan.kernels.jit import kernel
from sidegan.kernels.links import TOUCHING, ChainJoint, joint, placement, row

PLACE, AXIS, _FRAME = 9, 12, 15  # rows of a frame: rotation, origin, the joint's axis in the world
A, B, MIDDLE, _ENDS = 0, 3, 6, 9  # rows of a capsule: end points and midpoint of its axis

Span = tuple[int, int]  # consecutive samples: the first one, and their number


class DistanceBuffers(NamedTuple):
    """Scratch arrays of one thread: rows of lanes."""

    world: Array  # base and joint frames, (J + 1, _FRAME · LANES)
    ends: Array  # capsules, (C, _ENDS · LANES)
    gap: Array  # distances or their squares, (LANES,)


def distance_buffers(capsules: int, joints: int) -> DistanceBuffers:
    """Scratch arrays of one thread."""
    world = aligned(joints + 1, _FRAME * LANES)
    world[0].reshape(_FRAME, LANES)[[0, 4, 8]] = 1.0  # the base frame is the world frame
    return DistanceBuffers(world, aligned(capsules, _ENDS * LANES), aligned(1, LANES)[0])


@kernel
def _place(j: ChainJoint, state: Array, block: Block, base: Lanes, frame: Lanes) -> None:
    """Write a joint's frame in the world for a block of samples, from its parent's."""
    i, start, count = block
    for n in range(min(count, LANES)):
        at = start + n
        r, shift = placement(j, state[SIN, i, at], state[COS, i, at], state[Q, i, at])
        turn = load_turn(base, n)
        world = matrix_product(turn, r)
        store(frame, 0, n, world[0])
        store(frame, 3, n, world[1])
        store(frame, 6, n, world[2])
        store(frame, PLACE, n, add(load(base, PLACE, n), to_parent(turn, shift)))
        store(frame, AXIS, n, to_parent(world, j.axis))


@kernel
def _place_capsule(shapes: Shapes, k: int, frame: Lanes, ends: Lanes, count: int) -> None:
    """Write the end points and midpoint of a capsule's axis in the world for a block of samples."""
    one, two = row(shapes.ends[0], k), row(shapes.ends[1], k)
    for n in range(min(count, LANES)):
        turn, place = load_turn(frame, n), load(frame, PLACE, n)
        a, b = add(place, to_parent(turn, one)), add(place, to_parent(turn, two))
        store(ends, A, n, a)
        store(ends, B, n, b)
        store(ends, MIDDLE, n, scale(0.5, add(a, b)))


@kernel
def _push(chain: Chain, work: DistanceBuffers, at: Block, point: Vector, force: Vector, push: Array) -> None:
    """Add to the gradient in the positions, (J, S), that of a function with gradient ``force`` in a point."""
    frame, start, n = at
    for j in range(frame):
        link = work.world[j + 1]
        axis = load(link, AXIS, n)
        if chain.prismatic[j]:
            push[j, start + n] += dot(axis, force)
        else:
            push[j, start + n] += dot(cross(axis, less(point, load(link, PLACE, n))), force)


@kernel
def _pairs(
    chain: Chain, shapes: Shapes, span: Span, reach: float, weight: float, push: Array, work: DistanceBuffers
) -> tuple[float, float]:
    """Penalty and smallest distance of capsule pairs in a block of samples; see ``keep_apart``."""
    (start, count), total, gap = span, 0.0, work.gap
    least = reach
    for p in range(len(shapes.pairs)):
        i, k = shapes.pairs[p, 0], shapes.pairs[p, 1]
        one, two = work.ends[i], work.ends[k]
        for n in range(min(count, LANES)):
            apart = less(load(one, MIDDLE, n), load(two, MIDDLE, n))
            gap[n] = dot(apart, apart)
        for n in range(count):
            far = (reach if weight > 0 else least) + shapes.size[i] + shapes.size[k]
            if gap[n] < far * far:
                a, b = load(one, A, n), load(one, B, n)
                distance, a, b = near_segment(a, b, load(two, A, n), load(two, B, n))
                left = distance - (shapes.core[i] + shapes.core[k]) + shapes.closer[p]
                short, least = reach - left, min(least, left)
                if weight > 0 and short > 0:
                    total += weight * short * short
                    if distance > TOUCHING:  # crossing axes have no direction between them
                        force = scale(-2 * weight * short / distance, less(a, b))
                        _push(chain, work, (shapes.frame[i], start, n), a, force, push)
                        _push(chain, work, (shapes.frame[k], start, n), b, scale(-1.0, force), push)
    return total, least


@kernel
def _regions(
    chain: Chain, shapes: Shapes, span: Span, reach: float, weight: float, push: Array, work: DistanceBuffers
) -> tuple[float, float]:
    """Penalty and smallest distance of capsules from keep-out regions; see ``keep_apart``."""
    (start, count), total, gap = span, 0.0, work.gap
    least = reach
    for g in range(len(shapes.guarded)):
        r, k = shapes.guarded[g, 0], shapes.guarded[g, 1]
        ends = work.ends[k]
        for n in range(min(count, LANES)):
            gap[n] = from_region(shapes, r, load(ends, MIDDLE, n))
        for n in range(count):
            if gap[n] < (reach if weight > 0 else least) + shapes.size[k]:
                distance, point, away = near_region(shapes, r, load(ends, A, n), load(ends, B, n))
                short = reach - distance + shapes.outer[k]
                least = min(least, distance - shapes.outer[k])
                if weight > 0 and short > 0:
                    total += weight * short * short
                    force = scale(-2 * weight * short, away)
                    _push(chain, work, (shapes.frame[k], start, n), point, force, push)
    return total, least


@kernel
def keep_apart(
    chain: Chain,
    shapes: Shapes,
    states: Array,
    reach: float,
    weight: float,
    push: Array,
    work: DistanceBuffers,
) -> tuple[float, float, float]:
    """Penalty over all samples, and the smallest distances [m] of pairs and of regions, at most ``reach``.

    The penalty is ``weight`` times the squared shortfall of distances below ``reach``. Its gradient in the
    positions is added to push, (J, S). With weight zero, only the smallest distances are computed. States are
    (4, J, S), without accelerations.
    """
    samples, total = states.shape[2], 0.0
    near, clear = reach, reach
    if len(shapes.pairs) + len(shapes.guarded) == 0:
        return total, near, clear
    step = step_of(samples)
    for start in range(0, samples, step):
        count = min(step, samples - start)
        span = start, count
        for i in range(states.shape[1]):
            _place(joint(chain, i), states, (i, start, count), work.world[i], work.world[i + 1])
        for k in range(len(shapes.frame)):
            _place_capsule(shapes, k, work.world[shapes.frame[k]], work.ends[k], count)
        cost, least = _pairs(chain, shapes, span, reach if weight > 0 else near, weight, push, work)
        total, near = total + cost, min(near, least)
        cost, least = _regions(chain, shapes, span, reach if weight > 0 else clear, weight, push, work)
        total, clear = total + cost, min(clear, least)
    return total, near, clear
