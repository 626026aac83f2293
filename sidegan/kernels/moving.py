"""How near bodies may come, to each other or to a region, while the arm moves through a cell, compiled.

Along one direction both bodies lie in intervals, whose ends move evenly but for how their points' paths bend.
"""

import math

from sidegan.kernels.chain import Array, Chain, Shapes
from sidegan.kernels.closeness import near_region
from sidegan.kernels.formulas import Vector, add, cross, dot, less, times, to_child, to_parent
from sidegan.kernels.hulls import Placed, farthest
from sidegan.kernels.jit import inline
from sidegan.kernels.links import Frames, matrix, row, set_row


@inline
def place_twists(chain: Chain, world: Frames, rates: Array, twist: Array) -> None:
    """Write frames' angular velocities, and their velocities at the origin, (2, J + 1, 3)."""
    turning = moving = (0.0, 0.0, 0.0)
    set_row(twist[0], 0, turning)
    set_row(twist[1], 0, moving)
    for j in range(len(rates)):
        axis = times(rates[j], to_parent(matrix(world.turn, j + 1), row(chain.axis, j)))
        if chain.prismatic[j]:
            moving = add(moving, axis)
        else:
            turning = add(turning, axis)
            moving = add(moving, cross(row(world.place, j + 1), axis))
        set_row(twist[0], j + 1, turning)
        set_row(twist[1], j + 1, moving)


@inline
def frames_between(shapes: Shapes, p: int) -> tuple[int, int, int, int]:
    """The inner and the outer capsule of a pair, and their frames."""
    i, k = shapes.pairs[p, 0], shapes.pairs[p, 1]
    f, g = shapes.frame[i], shapes.frame[k]
    if f > g:
        i, k, f, g = k, i, g, f
    return i, k, f, g


@inline
def bend(reach: Array, p: int, between: tuple[int, int], motion: Array, half: float) -> float:
    """How far at most a point of a body, seen from another one, leaves its even motion [m].

    Half the square of the half width times the largest acceleration: joints' accelerations at their largest
    levers, and products of speeds at the lever of the joint further out.

    Args:
        reach: the largest lever of each joint wherever the arm is, (P, J).
        p: its row.
        between: the two bodies' frames, the inner one first.
        motion: bounds over the cell, of which rows 2 and 3 are speeds and accelerations, (4, J).
        half: half width of the cell [s].
    """
    acceleration = before = 0.0
    for j in range(between[0], between[1]):
        speed = motion[2, j]
        acceleration += reach[p, j] * (motion[3, j] + speed * (speed + 2.0 * before))
        before += speed
    return half * half / 2.0 * acceleration


@inline
def fastest(twist: Array, frames: tuple[int, int], ball: tuple[Vector, float]) -> float:
    """Largest speed [m/s] at which a point of a ball that moves with a frame moves, seen from another frame.

    Args:
        twist: how the frames move.
        frames: the one that it is seen from, and its own.
        ball: centre in the world and radius [m].
    """
    turning = less(row(twist[0], frames[1]), row(twist[0], frames[0]))
    moving = less(row(twist[1], frames[1]), row(twist[1], frames[0]))
    middle = add(moving, cross(turning, ball[0]))
    return math.sqrt(dot(middle, middle)) + math.sqrt(dot(turning, turning)) * ball[1]


@inline
def least_height(
    at: tuple[Shapes, Array], twist: Array, guard: tuple[int, int], margin: float, half: float
) -> float:
    """Least margin [m] of a capsule that is off a region, in a cell, if points moved evenly.

    A region is convex, so a plane that touches it at the point nearest to the capsule is never further away.

    Args:
        at: the arm's shapes, and their ends at the centre of the cell, (3, C, 3).
        twist: how the frames move there.
        guard: the region and the capsule.
        margin: of the capsule there.
        half: half width of the cell [s].
    """
    (shapes, ends), (r, k) = at, guard
    a, b = row(ends[0], k), row(ends[1], k)
    _, point, away = near_region(shapes, r, a, b)
    turning, moving = row(twist[0], shapes.frame[k]), row(twist[1], shapes.frame[k])
    lowest = 0.0
    for side in range(2):
        end = a if side == 0 else b
        rate = dot(away, add(moving, cross(turning, end)))
        low = dot(away, less(end, point)) - half * abs(rate)
        lowest = low if side == 0 else min(lowest, low)
    return margin + lowest


@inline
def _height(at: Placed, c: int, towards: Vector, inside: bool) -> float:
    """How far the axis of a capsule, or the corners of what is inside of it, reach in a direction."""
    if not inside:
        return max(dot(towards, row(at.ends[0], c)), dot(towards, row(at.ends[1], c)))
    hulls, f = at.bodies.hulls, at.bodies.shapes.frame[c]
    turn = matrix(at.world.turn, f)
    local = to_child(turn, towards)
    corner = farthest(hulls.corners, hulls.start[c], hulls.start[c + 1], local[0], local[1], local[2])
    return dot(local, row(hulls.corners, corner)) + dot(towards, row(at.world.place, f))


@inline
def least_gap(at: Placed, twist: Array, p: int, normal: Vector, half: float, inside: bool) -> float:
    """Least gap [m] along a direction between a pair's bodies in a cell, if points moved evenly.

    Args:
        at: where the arm is at the centre of the cell.
        twist: and how it moves there.
        p: the pair.
        normal: unit direction from the inner to the outer body.
        half: half width of the cell [s].
        inside: whether what is inside of the capsules is meant.
    """
    shapes = at.bodies.shapes
    i, k, f, g = frames_between(shapes, p)
    turning = add(row(twist[0], g), times(-1.0, row(twist[0], f)))
    moving = add(row(twist[1], g), times(-1.0, row(twist[1], f)))
    turned, rate = cross(normal, turning), dot(normal, moving)
    least = 0.0
    for side in range(2):
        time = half if side == 0 else -half
        d = add(normal, times(time, turned))
        low = time * rate - _height(at, k, times(-1.0, d), inside)
        least = low if side == 0 else min(least, low)
    radius = at.bodies.hulls.radius if inside else shapes.radius
    return least - _height(at, i, normal, inside) - (radius[i] + radius[k])
