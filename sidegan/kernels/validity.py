"""Margins of every constraint in many cells of many trajectories, one state at a time, in registers.

What can neither be its trajectory's smallest margin nor leave a cell undecided is skipped after a cheap test
that proves as much, and a part of a cell is asked only what its whole could not decide.
"""

from typing import NamedTuple

import numpy as np

from sidegan.kernels.cells import (
    Model,
    Motions,
    Work,
    bend_torques,
    bound_motion,
    cap_torques,
    place_balls,
    place_joints,
    roll_out,
    roll_out_jerk,
    torque_rates,
    torques,
)
from sidegan.kernels.chain import Array, Shapes
from sidegan.kernels.distances import between_segments, to_region
from sidegan.kernels.formulas import Vector, dot, drift, less, times, to_parent
from sidegan.kernels.hulls import Bodies, Placed, between_pieces, direction
from sidegan.kernels.jit import inline, kernel
from sidegan.kernels.links import matrix, place_capsules, row, set_row
from sidegan.kernels.moving import (
    bend,
    fastest,
    frames_between,
    least_gap,
    least_height,
    place_twists,
)

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
    asked: Array  # which constraints are looked at, (N, 7) bool; positions and velocities go together
    undecided: Array  # written: which of them leave the cell undecided, (N, 7) bool


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
    roll_out_jerk(motions, n, at, work.state)
    undecided = False
    for j in range(model.higher.shape[1]):
        jerk, snap = work.state[3, j], 0.0
        for k in range(c.shape[2]):
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
def _check_torques(
    model: Model, work: Work, motions: Motions, at: int, here: Here, smallest: Smallest
) -> bool:
    """The same for torques, by how fast they change at the centre of a cell and how that may change in it.

    More is found out about both only where it takes more: first bounds of their rates in the whole
    trajectory, then in the cell, then the rates themselves.
    """
    torques(model, work)
    best, half, bent = smallest.margin[here.n, TORQUE], motions.half, work.bent
    if _torques_near(model, work, best, half, work.cap[0]):
        bend_torques(model, work.motion, motions, here.n, work.sums, bent)
        if _torques_near(model, work, best, half, bent[0]):
            roll_out_jerk(motions, here.n, at, work.state)
            torque_rates(model, work)
            undecided = False
            for j in range(len(model.home)):
                margin = model.torque[j] - abs(work.torque[j])
                slack = min(half * bent[0, j], drift(work.rate[j], bent[1, j], half))
                undecided |= _settle(margin, slack, here, TORQUE, j, smallest)
            return undecided
    return False


@inline
def _torques_near(model: Model, work: Work, best: float, half: float, rates: Array) -> bool:
    """Whether a torque's margin is the smallest so far, or may vanish in the cell at such rates."""
    near = False
    for j in range(len(model.home)):
        margin = model.torque[j] - abs(work.torque[j])
        near |= not (margin >= best and margin >= half * rates[j])  # a rate that is no number decides nothing
    return near


@inline
def _unit(x: Vector) -> Vector:
    return times(1.0 / np.sqrt(dot(x, x)), x)


@inline
def _look_closer(
    model: Model, work: Work, p: int, known: tuple[float, float, float], half: float
) -> tuple[float, float]:
    """Margin of a pair, and how much it can change in the cell: of capsules, or of what is inside of them.

    Known are the capsules' margin, the smallest so far, and how far the links move if they move evenly; minus
    infinity where the cell is settled anyway. First by how far they move in any direction, then by how the
    bodies move along the line between them. What is inside is looked at no more closely than it takes to see
    that it is at least ``best``.
    """
    margin, best, evenly = known
    bodies, motion = Bodies(model.chain, model.shapes, model.hulls), work.motion
    at = Placed(bodies, work.world, work.ends)
    slack = _reached(model.pair_reach, p, motion)
    if margin >= slack:
        return margin, slack
    i, k, f, g = frames_between(model.shapes, p)
    between = f, g
    if margin > 0:
        a, b = work.ends[0], work.ends[1]
        normal = _unit(direction(row(a, k), row(b, k), row(a, i), row(b, i)))
        least = least_gap(at, work.twist, p, normal, half, False)
        least -= bend(model.pair_reach, p, between, motion, half)
        slack = min(slack, margin - least)
    if margin >= slack or not model.hulls.finer[p]:
        return margin, slack
    most = evenly + bend(model.piece_reach, p, between, motion, half)
    most = min(_reached(model.piece_reach, p, motion), most)
    inner = between_pieces(at, p, max(best, most, 0.0), work.search, row(work.axes, p))
    set_row(work.axes, p, row(work.search, 5))
    if not inner > margin:
        return margin, slack
    least = max(margin - slack, inner - most)  # the best of all guarantees
    if least < 0:
        first = model.shapes.pairs[p, 0]
        normal = to_parent(matrix(work.world.turn, model.shapes.frame[first]), row(work.search, 5))
        normal = _unit(times(-1.0, normal) if first == i else normal)
        moving = least_gap(at, work.twist, p, normal, half, True)
        least = max(least, moving - bend(model.piece_reach, p, between, motion, half))
    return inner, inner - least


@inline
def _balls_apart(shapes: Shapes, work: Work, p: int, need: float) -> bool:
    """Whether a pair's margin is surely at least ``need``, since the balls around its capsules are."""
    i, k = shapes.pairs[p, 0], shapes.pairs[p, 1]
    apart, far = less(row(work.ends[2], i), row(work.ends[2], k)), need + shapes.size[i] + shapes.size[k]
    return dot(apart, apart) >= far * far


@inline
def _links_apart(model: Model, work: Work, group: int, need: float) -> bool:
    """The same of all pairs of two links."""
    balls, frames = model.shapes.balls, model.links.frames
    f, g = frames[group, 0], frames[group, 1]
    apart = less(row(work.middles, f), row(work.middles, g))
    far = need + balls[f, 3] + balls[g, 3]
    return dot(apart, apart) >= far * far


@inline
def _moved(model: Model, work: Work, group: int, most: float, half: float) -> tuple[float, float]:
    """How far one of two links moves at most, seen from the other [m], and how far if it moves evenly.

    Known is how far in any direction, by how far joints move.
    """
    f, g = model.links.frames[group, 0], model.links.frames[group, 1]
    evenly = half * fastest(work.twist, (f, g), (row(work.middles, g), model.shapes.balls[g, 3]))
    bent = bend(model.links.most, group, (f, g), work.motion, half)
    return min(most, evenly + bent), evenly


@inline
def _margin_of_capsules(shapes: Shapes, work: Work, p: int) -> float:
    a, b, i, k = work.ends[0], work.ends[1], shapes.pairs[p, 0], shapes.pairs[p, 1]
    distance = between_segments(row(a, i), row(b, i), row(a, k), row(b, k))
    return distance - (shapes.radius[i] + shapes.radius[k])


@kernel
def _nearest_pair(shapes: Shapes, work: Work) -> int:
    """The pair whose capsules are nearest to each other."""
    nearest, least = 0, np.inf
    for p in range(len(shapes.pairs)):
        if not _balls_apart(shapes, work, p, least):
            margin = _margin_of_capsules(shapes, work, p)
            if margin < least:
                nearest, least = p, margin
    return nearest


@inline
def _check_pair(
    model: Model, work: Work, cell: tuple[Here, float], p: int, moved: tuple[float, float], smallest: Smallest
) -> bool:
    """Take a pair into account; whether it leaves the cell undecided.

    Moved is how far its links move at most, and how far if they move evenly.
    """
    (here, half), (most, evenly) = cell, moved
    best = smallest.margin[here.n, COLLISION]
    margin = _margin_of_capsules(model.shapes, work, p)
    if margin >= max(best, most):
        return False
    margin, slack = _look_closer(model, work, p, (margin, best, evenly), half)
    return _settle(margin, slack, here, COLLISION, p, smallest)


@inline
def _check_pairs(model: Model, work: Work, here: Here, half: float, smallest: Smallest) -> bool:
    """The same for pairs of capsules: only those whose balls are near enough to matter.

    Where capsules leave the cell undecided, what is inside of them decides, where that is known. At first the
    nearest pair is looked at, so that others need not be.
    """
    links, shapes = model.links, model.shapes
    place_balls(model, work)
    invalid = False
    for k in range(smallest.margin.shape[1]):
        invalid |= smallest.margin[here.n, k] < 0
    sure = invalid and not here.last  # what this cell leaves undecided is not looked at again
    first = _nearest_pair(shapes, work) if smallest.margin[here.n, COLLISION] == np.inf else -1
    undecided = False
    for group in range(0 if first < 0 else -1, len(links.frames)):
        start, stop, moved = 0, 1, (np.inf, np.inf)
        if group >= 0:
            moved = -np.inf, -np.inf
            best = smallest.margin[here.n, COLLISION]
            if not sure:
                most = _reached(links.most, group, work.motion)
                if _links_apart(model, work, group, max(best, most)):
                    continue
                moved = _moved(model, work, group, most, half)
            if _links_apart(model, work, group, max(best, moved[0])):
                continue
            start, stop = links.start[group], links.start[group + 1]
        for at in range(start, stop):
            p = links.pairs[at] if group >= 0 else first
            if not _balls_apart(shapes, work, p, max(smallest.margin[here.n, COLLISION], moved[0])):
                undecided |= _check_pair(model, work, (here, half), p, moved, smallest)
    return undecided


@inline
def _check_regions(model: Model, work: Work, here: Here, half: float, smallest: Smallest) -> bool:
    """The same for capsules and keep-out regions."""
    shapes, ends, motion = model.shapes, work.ends, work.motion
    most = _reached(model.region_most, 0, motion)
    undecided = False
    for g in range(len(shapes.guarded)):
        r, k = shapes.guarded[g, 0], shapes.guarded[g, 1]
        need = max(smallest.margin[here.n, KEEP_OUT], most)
        a, b, middle = row(ends[0], k), row(ends[1], k), row(ends[2], k)
        distance = to_region(shapes, r, a, b, middle, need + shapes.size[k])
        margin = distance - shapes.radius[k]
        if margin >= need:
            continue
        slack = _reached(model.region_reach, g, motion)
        if 0 < margin < slack:
            least = least_height((shapes, ends), work.twist, (r, k), margin, half)
            least -= bend(model.region_reach, g, (0, shapes.frame[k]), motion, half)
            slack = min(slack, margin - least)
        undecided |= _settle(margin, slack, here, KEEP_OUT, g, smallest)
    return undecided


@kernel
def visit(model: Model, work: Work, motions: Motions, cells: Cells, smallest: Smallest) -> None:
    """Update the smallest margins of trajectories; write which constraints leave which cells undecided."""
    which, rows, asked, unsure = cells.which, cells.rows, cells.asked, cells.undecided
    stop = 0
    while stop < len(which):
        start, n, limited = stop, which[stop], False
        work.axes[:] = 0.0
        while stop < len(which) and which[stop] == n:
            limited |= asked[stop, TORQUE]
            stop += 1
        if limited:
            cap_torques(model, work, motions, n, rows[start:stop])
        for cell in range(start, stop):
            here, wanted = Here(n, motions.times[rows[cell]], cells.last), asked[cell]
            roll_out(model.home, motions, n, rows[cell], work.state)
            bound_motion(work.state, motions, n, work.motion)
            unsure[cell] = False
            if wanted[POSITION]:
                unsure[cell, POSITION] = _check_limits(model, work, here, smallest)
            if wanted[ACCELERATION]:
                unsure[cell, ACCELERATION] = _check_higher(model, work, motions, rows[cell], here, smallest)
            if not (wanted[TORQUE] or wanted[COLLISION] or wanted[KEEP_OUT]):
                continue
            place_joints(model, work)
            if wanted[TORQUE]:
                unsure[cell, TORQUE] = _check_torques(model, work, motions, rows[cell], here, smallest)
            if wanted[COLLISION] or wanted[KEEP_OUT]:
                place_capsules(model.shapes, work.world, work.ends)
                place_twists(model.chain, work.world, work.state[1], work.twist)
            if wanted[COLLISION]:
                unsure[cell, COLLISION] = _check_pairs(model, work, here, motions.half, smallest)
            if wanted[KEEP_OUT]:
                unsure[cell, KEEP_OUT] = _check_regions(model, work, here, motions.half, smallest)


def everything(model: Model, cells: int) -> Array:
    """That all constraints of a model are looked at in some cells, (N, 7) bool."""
    wanted = np.zeros((cells, 7), dtype=bool)
    wanted[:, [POSITION, VELOCITY]] = True
    wanted[:, [ACCELERATION, JERK]] = model.higher.shape[1] > 0
    wanted[:, TORQUE] = np.isfinite(model.torque).any()
    wanted[:, COLLISION] = len(model.shapes.pairs) > 0
    wanted[:, KEEP_OUT] = len(model.shapes.guarded) > 0
    return wanted
