"""Compiled margins of every constraint in many cells of many trajectories, one state at a time.

A cheap test skips whatever can neither be its trajectory's smallest margin nor leave a cell undecided. Parts
of a cell are checked only for the constraints that the whole cell left undecided.
"""

import math
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array
from sidegan.kernels.bodies import (
    inner_and_outer,
    near_pair,
    near_pieces,
    pair_direction,
    place_capsule,
    place_joints,
)
from sidegan.kernels.cells import (
    Model,
    Motions,
    Work,
    bend,
    bend_torques,
    bound_motion,
    cell_torques,
    fastest,
    least_gap,
    least_height,
    place_twists,
    torque_rates,
    write_state,
)
from sidegan.kernels.chain import Shapes
from sidegan.kernels.distances import from_region, near_region
from sidegan.kernels.formulas import Vector, dot, largest_change, less, scale, to_parent
from sidegan.kernels.jit import inline, kernel
from sidegan.kernels.links import TOUCHING, matrix, row, set_row

POSITION, VELOCITY, TORQUE, COLLISION, KEEP_OUT, ACCELERATION, JERK = range(7)  # columns of the margins


class Smallest(NamedTuple):
    """Smallest margins so far, one row per trajectory and one column per constraint, (B, 7) each."""

    margin: Array
    element: Array  # index of the joint, pair or guarded capsule with this margin, int
    time: Array  # when it occurs [s]


class Cells(NamedTuple):
    """Cells to visit."""

    which: Array  # trajectory of each cell, grouped, (N,) int
    rows: Array  # row of the basis at each cell's centre, (N,) int
    last: bool  # last pass: undecided constraints count with their guaranteed margins
    asked: Array  # constraints to check, (N, 7) bool; positions go with velocities, accelerations with jerks
    undecided: Array  # output: constraints that leave the cell undecided, (N, 7) bool


class Here(NamedTuple):
    """The cell being visited."""

    n: int  # trajectory
    at: int  # row of the basis
    time: float  # centre [s]
    half: float  # half width [s]
    last: bool  # whether this is the last pass


@inline
def _reached(reach: Array, i: int, motion: Array) -> float:
    """Largest displacement [m] due to a cell's position changes, for the lever arms reach[i]."""
    total = 0.0
    for j in range(motion.shape[1]):
        total += reach[i, j] * motion[0, j]
    return total


@inline
def _settle(margin: float, slack: float, here: Here, what: tuple[int, int], smallest: Smallest) -> bool:
    """Update a column's smallest margin by an element's, which changes by at most ``slack`` in the cell.

    Returns whether it leaves the cell undecided.
    """
    (column, element), n, unsure = what, here.n, not margin >= slack  # NaN leaves the cell undecided
    if here.last and unsure and margin >= 0:
        margin -= slack
    if margin < smallest.margin[n, column] or margin != margin:
        smallest.margin[n, column] = margin
        smallest.element[n, column], smallest.time[n, column] = element, here.time
    return unsure


@inline
def _check_limits(model: Model, work: Work, here: Here, smallest: Smallest) -> bool:
    """Check positions and velocities; returns whether any of them leaves the cell undecided."""
    state, motion, undecided = work.state, work.motion, False
    for j in range(len(model.home)):
        margin = state[0, j] - model.lower[j]
        if not margin <= model.upper[j] - state[0, j]:
            margin = model.upper[j] - state[0, j]
        undecided |= _settle(margin, motion[0, j], here, (POSITION, j), smallest)
        margin = model.speed[j] - abs(state[1, j])
        undecided |= _settle(margin, motion[1, j], here, (VELOCITY, j), smallest)
    return undecided


@inline
def _check_higher(model: Model, work: Work, motions: Motions, here: Here, smallest: Smallest) -> bool:
    """Check accelerations and jerks, if limited; returns whether any leaves the cell undecided."""
    n, c, basis, undecided = here.n, motions.c, motions.basis, False
    for j in range(model.higher.shape[1]):
        jerk, snap = work.state[3, j], 0.0
        for k in range(c.shape[2]):
            snap += basis[here.at, 4, k] * c[n, j, k]
        slack = largest_change(jerk, motions.drifts[0, n, j], here.half)
        margin = model.higher[0, j] - abs(work.state[2, j])
        undecided |= _settle(margin, slack, here, (ACCELERATION, j), smallest)
        slack = largest_change(snap, motions.drifts[1, n, j], here.half)
        undecided |= _settle(model.higher[1, j] - abs(jerk), slack, here, (JERK, j), smallest)
    return undecided


@inline
def _check_torques(model: Model, work: Work, motions: Motions, here: Here, smallest: Smallest) -> bool:
    """Check torques, from their rates at the cell's centre and bounds over the cell.

    Exact rates are computed only if the bounds on the rates do not suffice.
    """
    cell_torques(model, work)
    best, half, bent, undecided = smallest.margin[here.n, TORQUE], here.half, work.bent, False
    bend_torques(model, work.motion, motions, here.n, work.sums, bent)
    near = False
    for j in range(len(model.home)):
        margin = model.torque[j] - abs(work.torque[0, j])
        near |= not (margin >= best and margin >= half * bent[0, j])
    if not near:
        return False
    torque_rates(model, work)
    for j in range(len(model.home)):
        slack = min(half * bent[0, j], largest_change(work.torque[1, j], bent[1, j], half))
        undecided |= _settle(model.torque[j] - abs(work.torque[0, j]), slack, here, (TORQUE, j), smallest)
    return undecided


@inline
def _outward(shapes: Shapes, p: int, x: Vector) -> Vector:
    """Unit vector from a pair's inner to its outer body; x points from its second to its first."""
    inner, _, _, _ = inner_and_outer(shapes, p)
    sign = -1.0 if inner == shapes.pairs[p, 0] else 1.0
    return scale(sign / math.sqrt(dot(x, x)), x)


@kernel
def _look_closer(
    model: Model, work: Work, p: int, margin: float, best: float, evenly: float, half: float
) -> tuple[float, float]:
    """Margin of a pair and its largest decrease in the cell, for the capsules or the hulls inside them.

    ``margin`` is the capsules', ``best`` the smallest so far, and ``evenly`` the links' displacement at
    constant velocity, or minus infinity if the cell need not be proven. The first bound is displacement in
    any direction; the second, motion along the line between the bodies. The distance of the hulls is refined
    only until it reaches ``best`` and their largest displacement.
    """
    motion, at, bodies, shapes = work.motion, work.at, model.bodies, model.bodies.shapes
    slack = _reached(model.pair_reach, p, motion)
    if margin >= slack:
        return margin, slack
    _, _, f, g = inner_and_outer(shapes, p)
    if margin > 0:
        normal = _outward(shapes, p, pair_direction(shapes, at.ends, p))
        least = least_gap(bodies, at, work.twist, p, normal, half, False)
        slack = min(slack, margin - (least - bend(model.pair_reach, p, (f, g), motion, half)))
    if margin >= slack or not bodies.hulls.finer[p]:
        return margin, slack
    bent = bend(model.piece_reach, p, (f, g), motion, half)
    most = min(_reached(model.piece_reach, p, motion), evenly + bent)
    inner = near_pieces(bodies, at, p, max(best, most, 0.0), row(work.axes, p))
    found = row(at.search, 5)
    set_row(work.axes, p, found)
    if not inner > margin:
        return margin, slack
    least = max(margin - slack, inner - most)  # the best of all guarantees
    if least < 0:
        normal = _outward(shapes, p, to_parent(matrix(at.turn, shapes.frame[shapes.pairs[p, 0]]), found))
        least = max(least, least_gap(bodies, at, work.twist, p, normal, half, True) - bent)
    return inner, inner - least


@inline
def _capsules_apart(shapes: Shapes, ends: Array, p: int, need: float) -> bool:
    """Whether the bounding balls of a pair's capsules prove a margin of at least ``need``."""
    i, k = shapes.pairs[p, 0], shapes.pairs[p, 1]
    apart, far = less(row(ends[2], i), row(ends[2], k)), need + shapes.size[i] + shapes.size[k]
    return dot(apart, apart) >= far * far


@inline
def _check_pairs(model: Model, work: Work, here: Here, smallest: Smallest) -> bool:
    """Check pairs of capsules whose bounding balls are close enough to matter.

    Where the capsules leave the cell undecided, the hulls inside them decide, if known.
    """
    shapes, ends = model.bodies.shapes, work.at.ends
    least, undecided, invalid = smallest.margin[here.n], False, False
    for k in range(len(least)):
        invalid |= least[k] < 0
    sure = invalid and not here.last  # no later pass revisits an invalid trajectory
    farthest = -np.inf if sure else _reached(model.reach_most, 0, work.motion)
    for p in range(len(shapes.pairs)):
        if _capsules_apart(shapes, ends, p, max(least[COLLISION], farthest)):
            continue
        most = evenly = -np.inf
        if not sure:
            most = _reached(model.pair_reach, p, work.motion)
            if _capsules_apart(shapes, ends, p, max(least[COLLISION], most)):
                continue
            _, k, f, g = inner_and_outer(shapes, p)
            evenly = here.half * fastest(work.twist, (f, g), row(ends[2], k), shapes.size[k])
            most = min(most, evenly + bend(model.pair_reach, p, (f, g), work.motion, here.half))
        need = max(least[COLLISION], most)
        if _capsules_apart(shapes, ends, p, need):
            continue
        margin, _, _ = near_pair(shapes, ends, p)
        if not margin >= need:
            margin, slack = _look_closer(model, work, p, margin, least[COLLISION], evenly, here.half)
            undecided |= _settle(margin, slack, here, (COLLISION, p), smallest)
    return undecided


@inline
def _check_regions(model: Model, work: Work, here: Here, smallest: Smallest) -> bool:
    """Check capsules against keep-out regions; returns whether any leaves the cell undecided."""
    shapes, ends, motion, undecided = model.bodies.shapes, work.at.ends, work.motion, False
    most = _reached(model.reach_most, 0, motion)
    for g in range(len(shapes.guarded)):
        r, k = shapes.guarded[g, 0], shapes.guarded[g, 1]
        need = max(smallest.margin[here.n, KEEP_OUT], most)
        if from_region(shapes, r, row(ends[2], k)) >= need + shapes.size[k]:
            continue
        contact = near_region(shapes, r, row(ends[0], k), row(ends[1], k))
        margin = contact[0] - shapes.outer[k]
        if margin >= need:
            continue
        slack = _reached(model.region_reach, g, motion)
        if TOUCHING < margin < slack:
            least = least_height(shapes, ends, work.twist, k, contact, here.half)
            bent = bend(model.region_reach, g, (0, shapes.frame[k]), motion, here.half)
            slack = min(slack, margin - (least - bent))
        undecided |= _settle(margin, slack, here, (KEEP_OUT, g), smallest)
    return undecided


@kernel
def visit(model: Model, work: Work, motions: Motions, cells: Cells, smallest: Smallest) -> None:
    """Update the trajectories' smallest margins; write which constraints leave each cell undecided."""
    which, rows, asked, unsure = cells.which, cells.rows, cells.asked, cells.undecided
    shapes, before = model.bodies.shapes, -1
    for cell in range(len(which)):
        n, at, wanted = which[cell], rows[cell], asked[cell]
        if n != before:
            before = n
            work.axes[:] = 0.0
        here = Here(n, at, motions.times[at], motions.half, cells.last)
        write_state(model.home, motions, n, at, work.state)
        bound_motion(work.state, motions, n, work.motion)
        unsure[cell] = False
        if wanted[POSITION]:
            unsure[cell, POSITION] = _check_limits(model, work, here, smallest)
        if wanted[ACCELERATION]:
            unsure[cell, ACCELERATION] = _check_higher(model, work, motions, here, smallest)
        if not (wanted[TORQUE] or wanted[COLLISION] or wanted[KEEP_OUT]):
            continue
        place_joints(model.bodies.chain, work.state[0], work.at)
        if wanted[TORQUE]:
            unsure[cell, TORQUE] = _check_torques(model, work, motions, here, smallest)
        if wanted[COLLISION] or wanted[KEEP_OUT]:
            for c in range(len(shapes.frame)):
                place_capsule(shapes, c, work.at)
            place_twists(model.bodies.chain, work.at, work.state[1], work.twist)
        if wanted[COLLISION]:
            unsure[cell, COLLISION] = _check_pairs(model, work, here, smallest)
        if wanted[KEEP_OUT]:
            unsure[cell, KEEP_OUT] = _check_regions(model, work, here, smallest)


def everything(model: Model, cells: int) -> Array:
    """Mask that asks for all constraints of a model in every cell, (N, 7) bool."""
    wanted = np.zeros((cells, 7), dtype=bool)
    wanted[:, [POSITION, VELOCITY]] = True
    wanted[:, [ACCELERATION, JERK]] = model.higher.shape[1] > 0
    wanted[:, TORQUE] = np.isfinite(model.torque).any()
    wanted[:, COLLISION] = len(model.bodies.shapes.pairs) > 0
    wanted[:, KEEP_OUT] = len(model.bodies.shapes.guarded) > 0
    return wanted
