"""The penalised objective of one trajectory and its exact gradient, compiled from end to end.

The batch's code, ``sidegan.design.objective``, spends twenty times as long on a single trajectory, nearly all
of it outside of the arithmetic.
"""

import math
from typing import NamedTuple

import numpy as np

from sidegan.kernels import apart, goals, lanes, regressor, terms
from sidegan.kernels.chain import Array, Chain, Shapes
from sidegan.kernels.jit import kernel
from sidegan.kernels.lanes import COS, DDQ, DQ, SIN, Q, clear
from sidegan.kernels.limits import Limits
from sidegan.kernels.matrices import add_to, product
from sidegan.kernels.signals import combine
from sidegan.kernels.slopes import beyond
from sidegan.kernels.weighted import weighted_gram, weighted_slopes


class Plan(NamedTuple):
    """One situation: an arm among its regions, its trajectories, what is asked of them.

    A point x, (J, K), stands for the coefficients turn @ (size · x) of each joint.
    """

    chain: Chain
    shapes: Shapes
    columns: regressor.Columns  # base columns, ascending
    extra: terms.JointTerms  # what the model has beside rigid bodies, their parameters after the base's
    # lower triangular C of all P parameters; Cᵀ YᵀY C has the spectrum in an orthonormal basis, (P, P)
    subspace: Array
    home: Array  # position that trajectories start from, (J,) [rad or m]
    turn: Array  # (K, K)
    size: Array  # (J, K)
    basis: Array  # derivatives 0 to 2 of the K basis functions at T samples, (3, K, T)
    # derivatives 0, 1 and what ``higher`` limits at S finer ones, some of them the same, (2 + L, K, S)
    fine: Array
    torques: Limits  # what torques cost, at the samples
    bounds: Limits  # what positions, velocities and what is higher cost, at the finer samples
    higher: Array  # limits of accelerations, jerks, …, (L, J); infinite where nothing is limited
    close: float  # weight of what small distances lack, at the finer samples [1/m²]
    reach: float  # smallest distance that costs nothing [m]
    roots: Array  # of the weight of each joint's torques, (J,)
    goal: goals.Goal


class Room(NamedTuple):
    """Room for the kernel at work; not to be shared among threads."""

    c: Array  # coefficients, (J, K)
    states: Array  # (5, 1, J, T)
    fine: Array  # the same at the finer samples, without accelerations, (5, 1, J, S)
    line: Array  # one derivative at the finer samples, (J, S)
    lanes: lanes.Room
    y: Array  # regressor
    gram: Array  # (P, P)
    goal: goals.Room
    sets: Array  # inertial parameters of the directions, (P, 10 J)
    signals: terms.Signals
    slope: Array  # in positions, velocities and accelerations, (3, 1, J, T)
    push: Array  # in what is limited at the finer samples, (2 + L, 1, J, S)
    near: apart.Room
    back: Array  # slope in the coefficients, (J, K)


def room(plan: Plan) -> Room:
    """Room to work on a plan, and on any other with as many of everything."""
    joints, functions = plan.size.shape
    size, samples, finer = len(plan.subspace), plan.basis.shape[2], plan.fine.shape[2]
    return Room(
        np.zeros((joints, functions)),
        lanes.aligned(5, 1, joints, samples),
        lanes.aligned(5, 1, joints, finer),
        lanes.aligned(joints, finer),
        lanes.room(joints),
        lanes.aligned(size, joints * regressor.SPAN),
        np.zeros((size, size)),
        goals.room(size, plan.goal.smooth),
        np.zeros((size, 10 * joints)),
        terms.room(plan.extra, samples, size),
        lanes.aligned(3, 1, joints, samples),
        lanes.aligned(len(plan.fine), 1, joints, finer),
        apart.room(len(plan.shapes.frame), joints),
        np.zeros((joints, functions)),
    )


@kernel
def coefficients(plan: Plan, x: Array, c: Array) -> None:
    """Write the coefficients (J, K) [rad/s] of a point (J, K)."""
    for j in range(len(c)):
        for k in range(c.shape[1]):
            total = 0.0
            for m in range(c.shape[1]):
                total += plan.turn[k, m] * plan.size[j, m] * x[j, m]
            c[j, k] = total


@kernel
def _roll_out(plan: Plan, work: Room) -> None:
    """Write the states at both grids of samples."""
    fine, states = work.fine, work.states
    joints, samples, finer = len(plan.home), states.shape[3], fine.shape[3]
    every = finer // samples
    for j in range(joints):
        for n in range(finer):
            fine[Q, 0, j, n], fine[DQ, 0, j, n] = plan.home[j], 0.0
        clear(states[DDQ, 0, j])
    combine(work.c, plan.fine[0], 0, finer, fine[Q, 0], 0)
    combine(work.c, plan.fine[1], 0, finer, fine[DQ, 0], 0)
    combine(work.c, plan.basis[2], 0, samples, states[DDQ, 0], 0)
    for j in range(joints):
        for n in range(finer):
            fine[SIN, 0, j, n] = math.sin(fine[Q, 0, j, n])
            fine[COS, 0, j, n] = math.cos(fine[Q, 0, j, n])
        for n in range(samples):
            at = every * n + every // 2
            states[SIN, 0, j, n], states[COS, 0, j, n] = fine[SIN, 0, j, at], fine[COS, 0, j, at]
            states[Q, 0, j, n], states[DQ, 0, j, n] = fine[Q, 0, j, at], fine[DQ, 0, j, at]


@kernel
def _cost_of(x: Array, middle: float, limit: float, reserve: float, weight: float, slope: Array) -> float:
    """What a signal costs that leaves its range; writes its slopes."""
    total = 0.0
    for n in range(len(x)):
        excess = beyond(x[n] - middle, limit, reserve)
        slope[n] = 2.0 * weight / limit * excess
        total += excess * excess
    return weight * total


@kernel
def _bound(plan: Plan, work: Room) -> float:
    """What positions, velocities and higher derivatives cost; writes their slopes."""
    bounds, fine, push, total = plan.bounds, work.fine, work.push, 0.0
    weight, reserve = bounds.weight, bounds.reserve
    for j in range(len(bounds.room)):
        total += _cost_of(fine[Q, 0, j], bounds.middle[j], bounds.room[j], reserve, weight, push[0, 0, j])
        total += _cost_of(fine[DQ, 0, j], 0.0, bounds.speed[j], reserve, weight, push[1, 0, j])
    for r in range(len(plan.higher)):
        for j in range(len(work.line)):
            clear(work.line[j])
        combine(work.c, plan.fine[2 + r], 0, work.line.shape[1], work.line, 0)
        for j in range(len(work.line)):
            total += _cost_of(work.line[j], 0.0, plan.higher[r, j], reserve, weight, push[2 + r, 0, j])
    return total


@kernel
def _pull_back(plan: Plan, gradient: Array, work: Room) -> None:
    """Carry the slopes from both grids back to the point."""
    joints, functions = work.back.shape
    samples, finer = work.states.shape[3], work.fine.shape[3]
    for j in range(joints):
        for k in range(functions):
            total = 0.0
            for r in range(3):
                total += product(work.slope[r, 0, j], plan.basis[r, k], samples)
            for r in range(len(plan.fine)):
                total += product(work.push[r, 0, j], plan.fine[r, k], finer)
            work.back[j, k] = total
    for j in range(joints):
        clear(gradient[j])
        for k in range(functions):
            add_to(gradient[j], work.back[j, k], plan.turn[k], functions)
        for k in range(functions):
            gradient[j, k] *= plan.size[j, k]


@kernel
def objective(plan: Plan, x: Array, gradient: Array, work: Room) -> tuple[float, float]:
    """Goal and penalty of a point (J, K); writes the gradient of their sum, (J, K).

    Where there is no goal it is infinite, and the gradient zero.
    """
    coefficients(plan, x, work.c)
    _roll_out(plan, work)
    extra = plan.extra, work.signals
    weighted_gram(plan.chain, work.states, plan.columns, extra, plan.roots, work.gram, work.lanes, work.y)
    value, count = goals.goal_of(plan.goal, plan.subspace, work.gram, work.goal)
    for j in range(len(gradient)):
        clear(gradient[j])
    if not math.isfinite(value):
        return np.inf, 0.0
    columns, first, samples = plan.columns, plan.columns.first, work.states.shape[3]
    for k in range(count):
        work.goal.weights[k] /= samples
        for i in range(len(plan.home)):
            for m in range(first[i], first[i + 1]):
                work.sets[k, 10 * i + columns.kinds[m]] = work.goal.base[k, m]
        for e in range(len(plan.extra.kinds)):
            work.signals.shares[k, e] = work.goal.base[k, len(columns.kinds) + e]
    directions = work.sets, work.goal.weights[:count]
    cost = weighted_slopes(
        plan.chain, plan.torques, work.states, extra, plan.roots, directions, work.slope, work.lanes
    )
    cost += _bound(plan, work)
    cost += apart.keep_apart(plan.chain, plan.shapes, work.fine, plan.close, plan.reach, work.push, work.near)
    _pull_back(plan, gradient, work)
    return value, cost
