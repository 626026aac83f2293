"""Compiled motion of an arm within a cell: states, torques, distances, and bounds on their changes.

Along a direction each body spans an interval; ``bend`` bounds how far its ends leave constant velocity.
A twist is the angular velocity of every frame and its velocity at the world origin, (2, J + 1, 3).
"""

import math
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array
from sidegan.kernels.bodies import Pose, inner_and_outer, pose_for
from sidegan.kernels.chain import Bodies, Chain, Shapes
from sidegan.kernels.distances import Contact
from sidegan.kernels.formulas import (
    Vector,
    add,
    cross,
    dot,
    less,
    link_bounds,
    link_motion,
    link_motion_rate,
    scale,
    to_child,
    to_parent,
    wrench_bounds,
    wrench_bounds_in_parent,
    wrench_in_parent,
    wrench_of,
    wrench_rate,
    wrench_rate_in_parent,
)
from sidegan.kernels.gjk import farthest
from sidegan.kernels.jit import inline, inline_in_any_order, kernel
from sidegan.kernels.links import joint, matrix, row, set_row, ten


class Model(NamedTuple):
    """An arm in its workspace as arrays, float64 unless noted."""

    bodies: Bodies  # joints, capsules, the hulls inside them, and keep-out regions
    parameters: Array  # inertial parameters, (10 J,)
    home: Array  # start position of the trajectories, (J,) [rad or m]
    lower: Array  # position limits, (J,)
    upper: Array  # position limits, (J,)
    speed: Array  # velocity limits, (J,)
    torque: Array  # torque limits minus dry friction, (J,); infinite where unlimited
    viscous: Array  # viscous friction coefficient [N·m·s/rad or N·s/m], (J,)
    rotor: Array  # rotor inertia on the joint side [kg·m² or kg], (J,)
    higher: Array  # acceleration and jerk limits, (2, J), infinite where unlimited; (2, 0) if there are none
    pair_reach: Array  # largest lever arm of each joint for the relative motion of two capsules, (P, J)
    piece_reach: Array  # the same for the hulls inside them, (P, J)
    region_reach: Array  # largest lever arm of each joint for the motion of a guarded capsule, (K, J)
    reach_most: Array  # maximum over capsule pairs and guarded capsules, (1, J)
    travel: Array  # upper bound on the distance between a joint's frame and its parent's, (J,) [m]
    mass: Array  # absolute value, (J,) [kg]
    first: Array  # norm of the first moment of mass, (J,)
    spin: Array  # spectral norm of the inertia matrix, (J,)


class Motions(NamedTuple):
    """Trajectories on a grid of cells."""

    c: Array  # coefficients, (B, J, K)
    jerk: Array  # bound on the absolute jerk, (B, J)
    drifts: Array  # bounds on the absolute fourth and fifth derivatives, (2, B, J)
    basis: Array  # derivatives 0 to 4 of the basis at the cell centres, (T, 5, K)
    times: Array  # cell centres [s], (T,)
    half: float  # half width of the cells [s]


class Work(NamedTuple):
    """Intermediate results of one thread."""

    state: Array  # position, velocity, acceleration, jerk, (4, J)
    motion: Array  # bounds on position change, velocity change, speed and acceleration in a cell, (4, J)
    at: Pose  # pose of the arm
    wrench: Array  # force and moment on each link, and their rates, (4, J, 3)
    torque: Array  # torques and their rates, (2, J)
    sums: Array  # bounds on each link's force and moment, with their first two derivatives, (2, J, 3)
    bent: Array  # bounds on the torques' first and second derivatives in a cell, (2, J)
    twist: Array  # angular velocity of each frame, and its velocity at the world origin, (2, J + 1, 3)
    axes: Array  # last direction between each pair's hulls, in the first one's frame, or zero, (P, 3)


def work_space(model: Model) -> Work:
    """Scratch arrays of one thread for a model."""
    j, shapes = len(model.home), model.bodies.shapes
    return Work(
        state=np.zeros((4, j)),
        motion=np.zeros((4, j)),
        at=pose_for(shapes, j),
        wrench=np.zeros((4, j, 3)),
        torque=np.zeros((2, j)),
        sums=np.zeros((2, j, 3)),
        bent=np.zeros((2, j)),
        twist=np.zeros((2, j + 1, 3)),
        axes=np.zeros((len(shapes.pairs), 3)),
    )


@inline_in_any_order
def write_state(home: Array, motions: Motions, n: int, at: int, state: Array) -> None:
    """Write position, velocity, acceleration and jerk, (4, J), of trajectory n at a row of the basis."""
    c, basis = motions.c, motions.basis
    for j in range(c.shape[1]):
        q, dq, ddq, jerk = home[j], 0.0, 0.0, 0.0
        for k in range(c.shape[2]):
            q += basis[at, 0, k] * c[n, j, k]
            dq += basis[at, 1, k] * c[n, j, k]
            ddq += basis[at, 2, k] * c[n, j, k]
            jerk += basis[at, 3, k] * c[n, j, k]
        state[0, j], state[1, j], state[2, j], state[3, j] = q, dq, ddq, jerk


@inline
def bound_motion(state: Array, motions: Motions, n: int, motion: Array) -> None:
    """Write bounds on the motion in the cell around a state, (4, J), by Taylor's theorem."""
    half = motions.half
    for j in range(state.shape[1]):
        speed, acceleration, jerk = abs(state[1, j]), abs(state[2, j]), motions.jerk[n, j]
        motion[0, j] = half * (speed + half / 2 * (acceleration + half / 3 * jerk))
        motion[1, j] = half * (acceleration + half / 2 * jerk)
        motion[2, j] = speed + motion[1, j]
        motion[3, j] = acceleration + half * jerk


@inline
def cell_torques(model: Model, work: Work) -> None:
    """Inverse dynamics [N·m] by the recursive Newton-Euler algorithm, with rotors and viscous friction."""
    chain, at, still = model.bodies.chain, work.at, (0.0, 0.0, 0.0)
    joints, g = len(model.home), chain.gravity
    motion = still, still, (-g[0], -g[1], -g[2])
    for i in range(joints):
        r, shift = matrix(at.own, i), row(at.shift, i)
        j, rates = joint(chain, i), (work.state[1, i], work.state[2, i])
        motion = link_motion(j.axis, j.slides, r, shift, rates, motion)
        force, moment = wrench_of(ten(model.parameters, 10 * i), motion)
        set_row(work.wrench[0], i, force)
        set_row(work.wrench[1], i, moment)
    f, n = still, still
    for i in range(joints - 1, -1, -1):
        f, n = add(f, row(work.wrench[0], i)), add(n, row(work.wrench[1], i))
        own = model.viscous[i] * work.state[1, i] + model.rotor[i] * work.state[2, i]
        work.torque[0, i] = dot(row(chain.axis, i), f if chain.prismatic[i] else n) + own
        f, n = wrench_in_parent(matrix(at.own, i), row(at.shift, i), (f, n))


@kernel
def torque_rates(model: Model, work: Work) -> None:
    """Exact torque rates [N·m/s], by differentiating each step of ``cell_torques``, which must run first."""
    chain, at, still = model.bodies.chain, work.at, (0.0, 0.0, 0.0)
    joints, g = len(model.home), chain.gravity
    moving = (still, still, (-g[0], -g[1], -g[2])), (still, still, still)
    for i in range(joints):
        j, r = joint(chain, i), matrix(at.own, i)
        shifts = row(at.shift, i), scale(work.state[1, i], j.slide)
        rates = work.state[1, i], work.state[2, i], work.state[3, i]
        moving = link_motion_rate(j.axis, j.slides, r, shifts, rates, moving)
        rate = wrench_rate(ten(model.parameters, 10 * i), moving)
        set_row(work.wrench[2], i, rate[0])
        set_row(work.wrench[3], i, rate[1])
    f = n = df = dn = still
    for i in range(joints - 1, -1, -1):
        j, r = joint(chain, i), matrix(at.own, i)
        f, n = add(f, row(work.wrench[0], i)), add(n, row(work.wrench[1], i))
        df, dn = add(df, row(work.wrench[2], i)), add(dn, row(work.wrench[3], i))
        own = model.viscous[i] * work.state[2, i] + model.rotor[i] * work.state[3, i]
        work.torque[1, i] = dot(j.axis, df if chain.prismatic[i] else dn) + own
        shifts = row(at.shift, i), scale(work.state[1, i], j.slide)
        spin = scale((1.0 - j.slides) * work.state[1, i], j.axis)
        df, dn = wrench_rate_in_parent(spin, r, shifts, (f, n), (df, dn))
        f, n = wrench_in_parent(r, shifts[0], (f, n))


@kernel
def bend_torques(model: Model, motion: Array, motions: Motions, n: int, sums: Array, bent: Array) -> None:
    """Write bounds on the absolute first and second derivatives of every torque in a cell, (2, J)."""
    chain, travel = model.bodies.chain, model.travel
    g, slides = chain.gravity, chain.prismatic
    still, weight = (0.0, 0.0, 0.0), math.sqrt(g[0] ** 2 + g[1] ** 2 + g[2] ** 2)
    link = still, still, (weight, 0.0, 0.0)
    for i in range(len(travel)):
        own = motion[2, i], motion[3, i], motions.jerk[n, i], motions.drifts[0, n, i]
        link = link_bounds(slides[i], own, travel[i], link)
        force, moment = wrench_bounds(model.mass[i], model.first[i], model.spin[i], link)
        set_row(sums[0], i, force)
        set_row(sums[1], i, moment)
    f = m = still
    for i in range(len(travel) - 1, -1, -1):
        own = motion[2, i], motion[3, i], motions.jerk[n, i], motions.drifts[0, n, i]
        f, m = add(f, row(sums[0], i)), add(m, row(sums[1], i))
        viscous, rotor = model.viscous[i], model.rotor[i]
        bent[0, i] = (f[1] if slides[i] else m[1]) + viscous * own[1] + rotor * own[2]
        bent[1, i] = (f[2] if slides[i] else m[2]) + viscous * own[2] + rotor * own[3]
        f, m = wrench_bounds_in_parent(slides[i], own, travel[i], (f, m))


@inline
def place_twists(chain: Chain, at: Pose, rates: Array, twist: Array) -> None:
    """Write the twist of an arm at joint rates, (J,)."""
    turning = moving = (0.0, 0.0, 0.0)
    set_row(twist[0], 0, turning)
    set_row(twist[1], 0, moving)
    for j in range(len(rates)):
        axis = scale(rates[j], to_parent(matrix(at.turn, j + 1), row(chain.axis, j)))
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
    products of joint speeds at the lever arm of the outer joint. ``between`` holds the bodies' frames, the
    inner one first. Lever arms are reach[p]; rows 2 and 3 of motion bound speeds and accelerations, (4, J).
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
    return distance - shapes.outer[k] + lowest


@inline
def _height(bodies: Bodies, at: Pose, c: int, towards: Vector, inside: bool) -> float:
    """Largest extent in a direction of a capsule's axis, or of the corners of the hull inside it."""
    if not inside:
        return max(dot(towards, row(at.ends[0], c)), dot(towards, row(at.ends[1], c)))
    hulls, f = bodies.hulls, bodies.shapes.frame[c]
    local = to_child(matrix(at.turn, f), towards)
    corner = farthest(hulls.corners, hulls.start[c], hulls.start[c + 1], local)
    return dot(local, row(hulls.corners, corner)) + dot(towards, row(at.place, f))


@inline
def least_gap(
    bodies: Bodies, at: Pose, twist: Array, p: int, normal: Vector, half: float, inside: bool
) -> float:
    """Smallest gap [m] over a cell between the bodies of pair p along a normal, at constant velocity.

    The unit normal points from the inner to the outer body; ``inside`` selects the hulls, not the capsules.
    Pose and twist are those at the centre of the cell of half width ``half`` [s].
    """
    i, k, f, g = inner_and_outer(bodies.shapes, p)
    turning, moving = _between(twist, f, g)
    turned, rate = cross(normal, turning), dot(normal, moving)
    least = math.inf
    for side in range(2):
        time = half if side == 0 else -half
        towards = less(scale(-1.0, normal), scale(time, turned))
        least = min(least, time * rate - _height(bodies, at, k, towards, inside))
    radius = bodies.hulls.radius if inside else bodies.shapes.radius
    return least - _height(bodies, at, i, normal, inside) - (radius[i] + radius[k]) + bodies.shapes.closer[p]
