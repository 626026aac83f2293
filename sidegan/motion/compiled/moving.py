"""How near the bodies of a pair may come while the arm moves through a cell, compiled.

Along one direction both bodies lie in intervals, whose ends move evenly but for how their points' paths bend.
The plain twin is ``sidegan.validity.moving``.
"""

from sidegan.motion.compiled.chain import Array, Chain, Shapes
from sidegan.motion.compiled.formulas import Vector, add, cross, dot, times, to_child, to_parent
from sidegan.motion.compiled.hulls import Placed, farthest
from sidegan.motion.compiled.jit import inline
from sidegan.motion.compiled.links import Frames, matrix, row, set_row


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
def bend(shapes: Shapes, p: int, reach: Array, motion: Array, half: float) -> float:
    """How far at most a point of the outer body, seen from the inner one, leaves its even motion [m].

    Half the square of the half width times the largest acceleration: joints' accelerations at their largest
    levers, and products of speeds at the lever of the joint further out.

    Args:
        shapes: whose pair it is.
        p: the pair.
        reach: the largest lever of each joint wherever the arm is, (P, J).
        motion: bounds over the cell, of which rows 2 and 3 are speeds and accelerations, (4, J).
        half: half width of the cell [s].
    """
    _, _, inner, outer = frames_between(shapes, p)
    acceleration = before = 0.0
    for j in range(inner, outer):
        speed = motion[2, j]
        acceleration += reach[p, j] * (motion[3, j] + speed * (speed + 2.0 * before))
        before += speed
    return half * half / 2.0 * acceleration


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
