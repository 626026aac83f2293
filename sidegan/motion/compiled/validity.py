"""Margins of every constraint in many cells of many trajectories, one state at a time, in registers.

The compiled twin of the torch code in ``sidegan.validity``, which remains the reference: the same margins,
the same bounds of their change within a cell, the same smallest margins. What can neither be its
trajectory's smallest margin nor leave a cell undecided is skipped after a cheap test that proves as much.
"""

from typing import NamedTuple

import numpy as np

from sidegan.motion.compiled.cells import (
    Model,
    Motions,
    Work,
    bound_motion,
    bound_torque_rates,
    cap_torque_rates,
    place_joints,
    roll_out,
    torques,
)
from sidegan.motion.compiled.chain import Array
from sidegan.motion.compiled.distances import between_segments, to_region
from sidegan.motion.compiled.formulas import dot, drift, less
from sidegan.motion.compiled.hulls import between_pieces, outer_of, reached
from sidegan.motion.compiled.jit import inline, kernel
from sidegan.motion.compiled.links import place_capsules, row

POSITION, VELOCITY, TORQUE, COLLISION, KEEP_OUT, ACCELERATION, JERK = range(7)  # columns of the margins


class Smallest(NamedTuple):
    """Smallest margins so far, one row per trajectory and one column per constraint, (B, 7) each."""

    margin: Array  # the margins
    element: Array  # joint, pair or guarded capsule that each belongs to, int
    time: Array  # when it occurs [s]


class Cells(NamedTuple):
    """Cells to visit."""

    which: Array  # trajectory of each, (N,) int; equal ones follow each other
    rows: Array  # centre of each, a row of the basis, (N,) int
    last: bool  # whether what is undecided counts with its guaranteed margin
    undecided: Array  # written, (N,) bool


class Here(NamedTuple):
    """The cell being visited: its trajectory, its time [s], whether it is of the last pass."""

    n: int
    time: float
    last: bool


@inline
def _reached(reach: Array, i: int, motion: Array) -> float:
    """How far the position changes in a cell move something [m], by its reach[i]."""
    total = 0.0
    for j in range(motion.shape[1]):
        total += reach[i, j] * motion[0, j]
    return total


@inline
def _settle(margin: float, slack: float, here: Here, column: int, item: int, smallest: Smallest) -> bool:
    """Take a margin into account; whether the cell is undecided because of it."""
    n, unsure = here.n, not margin >= slack
    if here.last and unsure and margin >= 0:
        margin -= slack
    if margin < smallest.margin[n, column] or margin != margin:
        smallest.margin[n, column] = margin
        smallest.element[n, column], smallest.time[n, column] = item, here.time
    return unsure


@inline
def _check_limits(model: Model, work: Work, here: Here, smallest: Smallest) -> bool:
    """Take positions and velocities into account; whether one of them leaves the cell undecided."""
    n, state, motion, best = here.n, work.state, work.motion, smallest.margin
    undecided = False
    for j in range(len(model.home)):
        margin = state[0, j] - model.lower[j]
        if not margin <= model.upper[j] - state[0, j]:
            margin = model.upper[j] - state[0, j]
        if not margin >= max(best[n, POSITION], motion[0, j]):
            undecided |= _settle(margin, motion[0, j], here, POSITION, j, smallest)
        margin = model.speed[j] - abs(state[1, j])
        if not margin >= max(best[n, VELOCITY], motion[1, j]):
            undecided |= _settle(margin, motion[1, j], here, VELOCITY, j, smallest)
    return undecided


@inline
def _check_higher(
    model: Model, work: Work, motions: Motions, at: int, here: Here, smallest: Smallest
) -> bool:
    """The same for accelerations and jerks, where some are limited."""
    n, best, c, basis = here.n, smallest.margin, motions.c, motions.basis
    undecided = False
    for j in range(model.higher.shape[1]):
        jerk, snap = 0.0, 0.0
        for k in range(c.shape[2]):
            jerk += basis[at, 3, k] * c[n, j, k]
            snap += basis[at, 4, k] * c[n, j, k]
        margin = model.higher[0, j] - abs(work.state[2, j])
        slack = drift(jerk, motions.drifts[0, n, j], motions.half)
        if not margin >= max(best[n, ACCELERATION], slack):
            undecided |= _settle(margin, slack, here, ACCELERATION, j, smallest)
        margin = model.higher[1, j] - abs(jerk)
        slack = drift(snap, motions.drifts[1, n, j], motions.half)
        if not margin >= max(best[n, JERK], slack):
            undecided |= _settle(margin, slack, here, JERK, j, smallest)
    return undecided


@inline
def _check_torques(model: Model, work: Work, motions: Motions, here: Here, smallest: Smallest) -> bool:
    """The same for torques: the bound of their rates is taken in the cell only where the cap is too much."""
    torques(model, work)
    near = False
    for j in range(len(model.home)):
        margin = model.torque[j] - abs(work.torque[j])
        near |= not margin >= max(smallest.margin[here.n, TORQUE], motions.half * work.cap[j])
    if not near:
        return False
    bound_torque_rates(model, work.motion, motions.jerk[here.n], work.sums, work.rate)
    undecided = False
    for j in range(len(model.home)):
        margin = model.torque[j] - abs(work.torque[j])
        undecided |= _settle(margin, motions.half * work.rate[j], here, TORQUE, j, smallest)
    return undecided


@kernel
def _look_inside(model: Model, work: Work, p: int, margin: float, best: float) -> tuple[float, float]:
    """Margin of a pair, and how much it can change in the cell: of the capsules, or of what is inside of them.

    That of the capsules is bounded more closely before others are looked at. What is inside is not looked at
    more closely than is needed to see that it is at least ``best`` and settled.
    """
    chain, shapes, hulls = model.chain, model.shapes, model.hulls
    moves, ends = work.motion[0], work.ends
    slack = reached(chain, shapes, work.world, ends, p, moves, model.pair_reach, 0.0)
    if margin >= slack:
        return margin, slack
    beside = hulls.around[outer_of(shapes, p)]
    most = reached(chain, shapes, work.world, ends, p, moves, model.piece_reach, beside)
    inner = between_pieces(hulls, shapes, work.world, ends, p, max(best, most), work.search)
    if not inner > margin:
        return margin, slack
    return inner, min(most, inner - (margin - slack))  # the better of both guarantees


@inline
def _check_pairs(model: Model, work: Work, here: Here, smallest: Smallest) -> bool:
    """The same for pairs of capsules: only those whose balls are near enough to matter.

    Where capsules leave the cell undecided, what is inside of them decides, where that is known.
    """
    shapes, a, b, middle = model.shapes, work.ends[0], work.ends[1], work.ends[2]
    most = _reached(model.pair_most, 0, work.motion)
    for k in range(smallest.margin.shape[1]):
        if smallest.margin[here.n, k] < 0:
            most = -np.inf  # nothing that this cell leaves undecided is looked at again
    undecided = False
    for p in range(len(shapes.pairs)):
        i, j = shapes.pairs[p, 0], shapes.pairs[p, 1]
        need = max(smallest.margin[here.n, COLLISION], most)
        far = need + shapes.size[i] + shapes.size[j]
        apart = less(row(middle, i), row(middle, j))
        if dot(apart, apart) >= far * far:
            continue
        distance = between_segments(row(a, i), row(b, i), row(a, j), row(b, j))
        margin = distance - (shapes.radius[i] + shapes.radius[j])
        if not margin >= need:
            slack = _reached(model.pair_reach, p, work.motion)
            if model.hulls.finer[p] and not margin >= slack:
                margin, slack = _look_inside(model, work, p, margin, smallest.margin[here.n, COLLISION])
            undecided |= _settle(margin, slack, here, COLLISION, p, smallest)
    return undecided


@inline
def _check_regions(model: Model, work: Work, here: Here, smallest: Smallest) -> bool:
    """The same for capsules and keep-out regions."""
    shapes, ends = model.shapes, work.ends
    most = _reached(model.region_most, 0, work.motion)
    undecided = False
    for g in range(len(shapes.guarded)):
        r, k = shapes.guarded[g, 0], shapes.guarded[g, 1]
        need = max(smallest.margin[here.n, KEEP_OUT], most)
        a, b, middle = row(ends[0], k), row(ends[1], k), row(ends[2], k)
        distance = to_region(shapes, r, a, b, middle, need + shapes.size[k])
        margin = distance - shapes.radius[k]
        if not margin >= need:
            slack = _reached(model.region_reach, g, work.motion)
            undecided |= _settle(margin, slack, here, KEEP_OUT, g, smallest)
    return undecided


@kernel
def visit(model: Model, work: Work, motions: Motions, cells: Cells, smallest: Smallest) -> None:
    """Update the smallest margins of trajectories, and write which cells are undecided."""
    which, rows = cells.which, cells.rows
    limited = False
    for j in range(len(model.home)):
        limited |= model.torque[j] < np.inf
    shapes = len(model.shapes.pairs) + len(model.shapes.guarded) > 0
    stop = 0
    while stop < len(which):
        start, n = stop, which[stop]
        while stop < len(which) and which[stop] == n:
            stop += 1
        if limited:
            cap_torque_rates(model, work, motions, n, rows[start:stop])
        for cell in range(start, stop):
            here = Here(n, motions.times[rows[cell]], cells.last)
            roll_out(model.home, motions, n, rows[cell], work.state)
            bound_motion(work.state, motions, n, work.motion)
            unsure = _check_limits(model, work, here, smallest)
            unsure |= _check_higher(model, work, motions, rows[cell], here, smallest)
            place_joints(model, work)
            if limited:
                unsure |= _check_torques(model, work, motions, here, smallest)
            if shapes:
                place_capsules(model.shapes, work.world, work.ends)
                unsure |= _check_pairs(model, work, here, smallest)
                unsure |= _check_regions(model, work, here, smallest)
            cells.undecided[cell] = unsure
