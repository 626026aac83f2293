"""Compiled lower bounds on the distance of bodies from each other or from regions over a cell.

Along a direction each body spans an interval; ``bend`` bounds how far its ends leave constant velocity.
A twist is the angular velocity of every frame and its velocity at the world origin, (2, J + 1, 3).
"""

import math

from sidegan.base.arrays import Array
from sidegan.kernels.bodies import Bodies, Place, ordered
from sidegan.kernels.chain import Chain, Shapes
from sidegan.kernels.distances import Contact
from sidegan.kernels.formulas import Vector, add, cross, dot, less, times, to_child, to_parent
from sidegan.kernels.gjk import farthest
from sidegan.kernels.jit import inline
from sidegan.kernels.links import matrix, row, set_row


@inline
def place_twists(chain: Chain, at: Place, rates: Array, twist: Array) -> None:
    """Write the twist of an arm at joint rates, (J,)."""
    turning = moving = (0.0, 0.0, 0.0)
    set_row(twist[0], 0, turning)
    set_row(twist[1], 0, moving)
    for j in range(len(rates)):
        axis = times(rates[j], to_parent(matrix(at.turn, j + 1), row(chain.axis, j)))
        if chain.prismatic[j]:
            moving = add(moving, axis)
        else:
            turning = add(turning, axis)
            moving = add(moving, cross(row(at.place, j + 1), axis))
        set_row(twist[0], j + 1, turning)
        set_row(twist[1], j + 1, moving)


@inline
def bend(reach: Array, p: int, between: tuple[int, int], motion: Array, half: float) -> float:
    """Largest deviation [m] of a body's points from constant velocity in the cell, relative to another body.

    This is half² / 2 times the largest acceleration: joint accelerations at their largest lever arms, plus
    products of joint speeds at the lever arm of the outer joint.

    Args:
        reach: largest lever arm of each joint over all positions, (P, J).
        p: row of ``reach``.
        between: the two bodies' frames, the inner one first.
        motion: bounds over the cell, (4, J); rows 2 and 3 are speeds and accelerations.
        half: half width of the cell [s].
    """
    acceleration = before = 0.0
    for j in range(between[0], between[1]):
        speed = motion[2, j]
        acceleration += reach[p, j] * (motion[3, j] + speed * (speed + 2.0 * before))
        before += speed
    return half * half / 2.0 * acceleration


@inline
def _between(twist: Array, f: int, g: int) -> tuple[Vector, Vector]:
    """Twist of frame g relative to frame f."""
    return less(row(twist[0], g), row(twist[0], f)), less(row(twist[1], g), row(twist[1], f))


@inline
def fastest(twist: Array, frames: tuple[int, int], centre: Vector, radius: float) -> float:
    """Largest speed [m/s], relative to the first frame, of the points of a ball fixed to the second one."""
    turning, moving = _between(twist, frames[0], frames[1])
    middle = add(moving, cross(turning, centre))
    return math.sqrt(dot(middle, middle)) + math.sqrt(dot(turning, turning)) * radius


@inline
def least_height(shapes: Shapes, ends: Array, twist: Array, k: int, contact: Contact, half: float) -> float:
    """Smallest margin [m] over a cell of capsule k outside a region, for points at constant velocity.

    A region is convex, so its tangent plane at the nearest point is never farther away than the region. Ends
    (3, C, 3), twist and contact are those at the centre of the cell of half width ``half`` [s].
    """
    distance, point, away = contact
    turning, moving = row(twist[0], shapes.frame[k]), row(twist[1], shapes.frame[k])
    lowest = math.inf
    for side in range(2):
        end = row(ends[side], k)
        rate = dot(away, add(moving, cross(turning, end)))
        lowest = min(lowest, dot(away, less(end, point)) - half * abs(rate))
    return distance - shapes.radius[k] + lowest


@inline
def _height(bodies: Bodies, at: Place, c: int, towards: Vector, inside: bool) -> float:
    """Largest extent in a direction of a capsule's axis, or of the corners of the hull inside it."""
    if not inside:
        return max(dot(towards, row(at.ends[0], c)), dot(towards, row(at.ends[1], c)))
    hulls, f = bodies.hulls, bodies.shapes.frame[c]
    local = to_child(matrix(at.turn, f), towards)
    corner = farthest(hulls.corners, hulls.start[c], hulls.start[c + 1], local)
    return dot(local, row(hulls.corners, corner)) + dot(towards, row(at.place, f))


@inline
def least_gap(
    bodies: Bodies, at: Place, twist: Array, p: int, normal: Vector, half: float, inside: bool
) -> float:
    """Smallest gap [m] over a cell between the bodies of pair p along a normal, at constant velocity.

    The unit normal points from the inner to the outer body; ``inside`` selects the hulls, not the capsules.
    Pose and twist are those at the centre of the cell of half width ``half`` [s].
    """
    i, k, f, g = ordered(bodies.shapes, p)
    turning, moving = _between(twist, f, g)
    turned, rate = cross(normal, turning), dot(normal, moving)
    least = math.inf
    for side in range(2):
        time = half if side == 0 else -half
        towards = less(times(-1.0, normal), times(time, turned))
        least = min(least, time * rate - _height(bodies, at, k, towards, inside))
    radius = bodies.hulls.radius if inside else bodies.shapes.radius
    return least - _height(bodies, at, i, normal, inside) - (radius[i] + radius[k]) + bodies.shapes.closer[p]
