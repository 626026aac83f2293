"""Compiled penalty for capsules that come too close to each other or to a region, and its slope."""

import math
from typing import NamedTuple

import numpy as np

from sidegan.motion.compiled.chain import BALL, BOX, CONVEX, PLANE, Array, Chain, Shapes
from sidegan.motion.compiled.distances import lowest_crossing, nearest_to_box, outwards, point_to_box
from sidegan.motion.compiled.formulas import Vector, add, cross, dot, less, times, to_parent
from sidegan.motion.compiled.jit import inline, kernel
from sidegan.motion.compiled.links import (
    TOUCHING,
    Frames,
    frames,
    joint,
    locate,
    matrix,
    nearest,
    place_capsules,
    placement,
    row,
    set_row,
)

Span = tuple[int, int]  # two indices
Segment = tuple[Vector, Vector]  # the ends of a capsule's axis


class Room(NamedTuple):
    """Room for the kernel at work: frames, the joints' axes (J, 3), the capsules' ends (3, C, 3)."""

    world: Frames
    axes: Array
    ends: Array


def room(shapes: Shapes, joints: int) -> Room:
    """Room to work in; not to be shared among threads."""
    return Room(frames(joints), np.zeros((joints, 3)), np.zeros((3, len(shapes.frame), 3)))


@kernel
def _push(chain: Chain, work: Room, frame: int, point: Vector, force: Vector, slope: Array) -> None:
    """Add the slope in the positions, (J,), of what has the slope ``force`` in a point of a link."""
    for j in range(frame):
        axis = row(work.axes, j)
        if chain.prismatic[j]:
            slope[j] += dot(axis, force)
        else:
            slope[j] += dot(cross(axis, less(point, row(work.world.place, j + 1))), force)


@inline
def pull_of_pair(
    shapes: Shapes, pair: Span, reach: float, one: Segment, two: Segment
) -> tuple[float, Vector, Vector, Vector]:
    """How far two capsules fall short of ``reach`` [m], their nearest points, and a slope.

    The slope is that of the square in the first point; in the second it is the opposite. It is nothing where
    the axes cross.
    """
    i, k = pair
    a, b = nearest(one[0], one[1], two[0], two[1])
    gap = less(a, b)
    distance = math.sqrt(dot(gap, gap))
    excess = reach - max(distance, TOUCHING) + shapes.core[i] + shapes.core[k]
    return excess, a, b, times(-2 * excess / distance if distance > TOUCHING else 0.0, gap)


@kernel
def _pairs(chain: Chain, shapes: Shapes, reach: float, slope: Array, work: Room) -> float:
    """What one state's pairs cost; adds the slope."""
    total, a, b, middle = 0.0, work.ends[0], work.ends[1], work.ends[2]
    for p in range(len(shapes.pairs)):
        i, k = shapes.pairs[p, 0], shapes.pairs[p, 1]
        apart, far = less(row(middle, i), row(middle, k)), reach + shapes.size[i] + shapes.size[k]
        if dot(apart, apart) >= far * far:
            continue
        axes = (row(a, i), row(b, i)), (row(a, k), row(b, k))
        excess, one, two, force = pull_of_pair(shapes, (i, k), reach, axes[0], axes[1])
        if excess > 0:
            total += excess * excess
            _push(chain, work, shapes.frame[i], one, force, slope)
            _push(chain, work, shapes.frame[k], two, times(-1.0, force), slope)
    return total


@inline
def _near_ball(centre: Vector, radius: float, a: Vector, b: Vector) -> tuple[float, Vector, Vector]:
    """Signed distance [m] of a segment to a ball, its nearest point and the direction away."""
    point, _ = nearest(a, b, centre, centre)
    gap = less(point, centre)
    distance = max(math.sqrt(dot(gap, gap)), TOUCHING)
    return distance - radius, point, times(1 / distance, gap)


@inline
def _near_body(shapes: Shapes, r: int, a: Vector, b: Vector) -> tuple[float, Vector, Vector]:
    """The same for a convex body: away from both planes that cross at the nearest point."""
    first, last = int(shapes.regions[r, 4]), int(shapes.regions[r, 5])
    distance, share, one, two, part = lowest_crossing(shapes.planes, first, last, a, b)
    planes = shapes.planes
    ways = (planes[one, 0], planes[one, 1], planes[one, 2]), (planes[two, 0], planes[two, 1], planes[two, 2])
    away = add(times(1 - part, ways[0]), times(part, ways[1]))
    return distance, add(times(1 - share, a), times(share, b)), away


@inline
def _near_region(shapes: Shapes, r: int, a: Vector, b: Vector) -> tuple[float, Vector, Vector]:
    """The same for any region but a box, which may be left along two faces at once."""
    if shapes.kinds[r] == BALL:
        return _near_ball(row(shapes.regions, r), shapes.regions[r, 3], a, b)
    if shapes.kinds[r] == CONVEX:
        return _near_body(shapes, r, a, b)
    normal = row(shapes.regions, r)
    low, high = dot(normal, a), dot(normal, b)
    return min(low, high) - shapes.regions[r, 3], a if low < high else b, normal


@inline
def from_region(shapes: Shapes, r: int, x: Vector) -> float:
    """Distance [m] of a point from a region, or less."""
    numbers, kind = shapes.regions, shapes.kinds[r]
    if kind == PLANE:
        return dot(row(numbers, r), x) - numbers[r, 3]
    apart = less(x, row(numbers, r))
    if kind == BOX:
        return point_to_box(apart, (numbers[r, 3], numbers[r, 4], numbers[r, 5]))
    return math.sqrt(dot(apart, apart)) - numbers[r, 3]


@inline
def pull_of_region(
    shapes: Shapes, guard: Span, reach: float, a: Vector, b: Vector
) -> tuple[float, Vector, Vector, Vector, Vector]:
    """How far a capsule falls short of ``reach`` from a region [m], and two points with their slopes.

    The slopes are those of the square; only in a box, which is left along two faces, are both something.
    """
    r, k = guard
    if shapes.kinds[r] != BOX:
        distance, point, away = _near_region(shapes, r, a, b)
        excess = reach - distance + shapes.radius[k]
        return excess, point, times(-2 * excess, away), point, (0.0, 0.0, 0.0)
    numbers = shapes.regions
    centre, half = row(numbers, r), (numbers[r, 3], numbers[r, 4], numbers[r, 5])
    inside, along = less(a, centre), less(b, a)
    distance, before, after, share = nearest_to_box(half, inside, less(b, centre))
    excess = reach - distance + shapes.radius[k]
    one, two = add(inside, times(before, along)), add(inside, times(after, along))
    force = times(-2 * excess * share, outwards(one, half))
    other = times(-2 * excess * (1.0 - share), outwards(two, half))
    return excess, add(one, centre), force, add(two, centre), other


@kernel
def _regions(chain: Chain, shapes: Shapes, reach: float, slope: Array, work: Room) -> float:
    """What one state's regions cost; adds the slope."""
    total = 0.0
    for p in range(len(shapes.guarded)):
        r, k = shapes.guarded[p, 0], shapes.guarded[p, 1]
        if from_region(shapes, r, row(work.ends[2], k)) >= reach + shapes.size[k]:
            continue
        a, b = row(work.ends[0], k), row(work.ends[1], k)
        excess, one, force, two, other = pull_of_region(shapes, (r, k), reach, a, b)
        if excess > 0:
            total += excess * excess
            _push(chain, work, shapes.frame[k], one, force, slope)
            if shapes.kinds[r] == BOX:
                _push(chain, work, shapes.frame[k], two, other, slope)
    return total


@kernel
def closeness(
    chain: Chain, shapes: Shapes, states: Array, reach: float, value: Array, slope: Array, work: Room
) -> None:
    """Add the squares of how far distances fall below ``reach`` [m], summed over time, and their slopes.

    Added to are value [m²], (B,), and slope [m²/rad], (B, J, T).
    """
    for b in range(states.shape[1]):
        for t in range(states.shape[3]):
            for i in range(states.shape[2]):
                r, shift = placement(
                    joint(chain, i), states[0, b, i, t], states[1, b, i, t], states[2, b, i, t]
                )
                locate(work.world, i, r, shift)
                set_row(work.axes, i, to_parent(matrix(work.world.turn, i + 1), row(chain.axis, i)))
            place_capsules(shapes, work.world, work.ends)
            pushed = slope[b, :, t]
            value[b] += _pairs(chain, shapes, reach, pushed, work)
            value[b] += _regions(chain, shapes, reach, pushed, work)
