"""Motion of an arm in its workspace within a cell, compiled: states, frames, torques, and how they change."""

import math
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array
from sidegan.kernels.bodies import Bodies, Place, place_for
from sidegan.kernels.formulas import (
    add,
    carried,
    carried_bounds,
    carried_rate,
    cell_bounds,
    dot,
    link_bounds,
    moved,
    moved_rate,
    times,
    wrench_bounds,
    wrench_of,
    wrench_rate,
)
from sidegan.kernels.jit import inline, inline_in_any_order, kernel
from sidegan.kernels.links import joint, matrix, row, set_row, ten


class Model(NamedTuple):
    """An arm in its workspace as arrays, float64 where nothing else is said."""

    bodies: Bodies  # joints, capsules and what is inside of them, and what they are kept apart from
    parameters: Array  # inertial parameters, (10 J,)
    home: Array  # position that trajectories start from, (J,) [rad or m]
    lower: Array  # position limits, (J,)
    upper: Array  # position limits, (J,)
    speed: Array  # velocity limits, (J,)
    torque: Array  # torque limits less dry friction, (J,); infinite where nothing is limited
    viscous: Array  # friction [N·m·s/rad or N·s/m], (J,)
    rotor: Array  # inertia of rotors behind the gears [kg·m² or kg], (J,)
    higher: Array  # limits of acceleration and jerk, (2, J), likewise; (2, 0) where there are none at all
    pair_reach: Array  # how far the motion of a joint moves two capsules against each other, (P, J)
    piece_reach: Array  # how far it moves what is inside of them, (P, J)
    region_reach: Array  # how far the motion of a joint moves a capsule, (K, J)
    reach_most: Array  # the largest of both, (1, J)
    travel: Array  # upper bound of the distance between a joint's frame and its parent's, (J,) [m]
    mass: Array  # absolute, (J,) [kg]
    first: Array  # norm of the first moment of mass, (J,)
    spin: Array  # spectral norm of the inertia matrix, (J,)


class Motions(NamedTuple):
    """Trajectories on a grid of cells."""

    c: Array  # coefficients, (B, J, K)
    jerk: Array  # bound of the absolute jerk, (B, J)
    drifts: Array  # bounds of the absolute fourth and fifth derivative, (2, B, J)
    basis: Array  # derivatives 0 to 4 of the basis at the centres of cells, (T, 5, K)
    times: Array  # the same centres [s], (T,)
    half: float  # half width of the cells [s]


class Work(NamedTuple):
    """Results of one step for the next; each thread needs its own."""

    state: Array  # position, velocity, acceleration, jerk, (4, J)
    motion: Array  # bounds of position change, velocity change, speed and acceleration in a cell, (4, J)
    at: Place  # where the arm is
    wrench: Array  # force and moment on a link, and their rates, (4, J, 3)
    torque: Array  # and its rate, (2, J)
    sums: Array  # bounds of a link's force and moment, of their rates and second derivatives, (6, J)
    bent: Array  # bounds of the torques' rates and second derivatives in a cell, (2, J)
    twist: Array  # angular velocity of a frame, and the velocity at the origin, (2, J + 1, 3)
    axes: Array  # between the hulls of pairs where last looked at, in the first one's frame; or zero, (P, 3)


def work_space(model: Model) -> Work:
    """Arrays that one thread needs for a model."""
    j, shapes = len(model.home), model.bodies.shapes
    sizes = {"wrench": (4, j, 3), "sums": (6, j), "twist": (2, j + 1, 3), "axes": (len(shapes.pairs), 3)}
    sizes |= dict.fromkeys(("state", "motion"), (4, j)) | dict.fromkeys(("torque", "bent"), (2, j))
    return Work(at=place_for(shapes, j), **{name: np.zeros(size) for name, size in sizes.items()})


@inline_in_any_order
def roll_out(home: Array, motions: Motions, n: int, at: int, state: Array) -> None:
    """Position, velocity, acceleration and jerk of trajectory n at a row of the basis, in a state (4, J)."""
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
    """Bounds of the motion in the cell around a state."""
    for j in range(state.shape[1]):
        bounds = cell_bounds(state[1, j], state[2, j], motions.jerk[n, j], motions.half)
        motion[0, j], motion[1, j], motion[2, j], motion[3, j] = bounds


@inline
def torques(model: Model, work: Work) -> None:
    """Inverse dynamics [N·m] by the recursive Newton-Euler algorithm, with rotors and viscous friction."""
    chain, at, still = model.bodies.chain, work.at, (0.0, 0.0, 0.0)
    joints, g = len(model.home), chain.gravity
    motion = still, still, (-g[0], -g[1], -g[2])
    for i in range(joints):
        r, shift = matrix(at.own, i), row(at.shift, i)
        j, rates = joint(chain, i), (work.state[1, i], work.state[2, i])
        motion = moved(j.axis, j.slides, r, shift, rates, motion)
        force, moment = wrench_of(ten(model.parameters, 10 * i), motion)
        set_row(work.wrench[0], i, force)
        set_row(work.wrench[1], i, moment)
    f, n = still, still
    for i in range(joints - 1, -1, -1):
        f, n = add(f, row(work.wrench[0], i)), add(n, row(work.wrench[1], i))
        own = model.viscous[i] * work.state[1, i] + model.rotor[i] * work.state[2, i]
        work.torque[0, i] = dot(row(chain.axis, i), f if chain.prismatic[i] else n) + own
        f, n = carried(matrix(at.own, i), row(at.shift, i), (f, n))


@kernel
def torque_rates(model: Model, work: Work) -> None:
    """Exact rates of ``torques`` [N·m/s], which comes before: the rate of each of its steps."""
    chain, at, still = model.bodies.chain, work.at, (0.0, 0.0, 0.0)
    joints, g = len(model.home), chain.gravity
    moving = (still, still, (-g[0], -g[1], -g[2])), (still, still, still)
    for i in range(joints):
        j, r = joint(chain, i), matrix(at.own, i)
        shifts = row(at.shift, i), times(work.state[1, i], j.slide)
        rates = work.state[1, i], work.state[2, i], work.state[3, i]
        moving = moved_rate((j.axis, j.slides), r, shifts, rates, moving)
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
        shifts = row(at.shift, i), times(work.state[1, i], j.slide)
        spin = times((1.0 - j.slides) * work.state[1, i], j.axis)
        df, dn = carried_rate(spin, r, shifts, (f, n), (df, dn))
        f, n = carried(r, shifts[0], (f, n))


@kernel
def bend_torques(model: Model, motion: Array, motions: Motions, n: int, sums: Array, bent: Array) -> None:
    """Upper bounds of the absolute rate and second derivative of every torque in a cell, (2, J)."""
    chain, travel = model.bodies.chain, model.travel
    g, slides = chain.gravity, chain.prismatic
    still, weight = (0.0, 0.0, 0.0), math.sqrt(g[0] ** 2 + g[1] ** 2 + g[2] ** 2)
    link = still, still, (weight, 0.0, 0.0)
    for i in range(len(travel)):
        own = motion[2, i], motion[3, i], motions.jerk[n, i], motions.drifts[0, n, i]
        link = link_bounds(slides[i], own, travel[i], link)
        force, moment = wrench_bounds(model.mass[i], model.first[i], model.spin[i], link)
        sums[0, i], sums[1, i], sums[2, i] = force
        sums[3, i], sums[4, i], sums[5, i] = moment
    f = m = still
    for i in range(len(travel) - 1, -1, -1):
        own = motion[2, i], motion[3, i], motions.jerk[n, i], motions.drifts[0, n, i]
        f = add(f, (sums[0, i], sums[1, i], sums[2, i]))
        m = add(m, (sums[3, i], sums[4, i], sums[5, i]))
        viscous, rotor = model.viscous[i], model.rotor[i]
        bent[0, i] = (f[1] if slides[i] else m[1]) + viscous * own[1] + rotor * own[2]
        bent[1, i] = (f[2] if slides[i] else m[2]) + viscous * own[2] + rotor * own[3]
        f, m = carried_bounds(slides[i], own, travel[i], (f, m))
