"""The penalised objective of one trajectory and its exact gradient, compiled from end to end."""

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
    """An arm among its regions, its trajectories, and what is asked of them.

    A point x, (J, K), stands for the coefficients matrix @ x of each joint.
    """

    chain: Chain
    shapes: Shapes
    columns: regressor.Columns  # base columns, ascending
    extra: terms.JointTerms  # what the model has beside rigid bodies, their parameters after the base's
    # lower triangular C of all P parameters; Cᵀ YᵀY C has the spectrum in an orthonormal basis, (P, P)
    subspace: Array
    home: Array  # position that trajectories start from, (J,) [rad or m]
    matrix: Array  # coefficients of points, (J, K, K), symmetric
    basis: Array  # derivatives 0 to 2 of the K basis functions at T samples, (3, K, T)
    # derivatives 0, 1 and what ``higher`` limits at S finer ones, some of them the same, (2 + L, K, S)
    fine: Array
    limits: Limits  # what torques cost, at the samples, and all else, at the finer ones
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
    sets: Array  # inertial parameters of the directions, (D, 10 J)
    signals: terms.Signals
    slope: Array  # in positions, velocities and accelerations, (3, 1, J, T)
    push: Array  # in what is limited at the finer samples, (2 + L, 1, J, S)
    near: apart.Room
    back: Array  # slope in the coefficients, (J, K)


def room(plan: Plan) -> Room:
    """Room to work on a plan, and on any other with as many of everything."""
    joints, functions, _ = plan.matrix.shape
    size, samples, finer = len(plan.subspace), plan.basis.shape[2], plan.fine.shape[2]
    goal = goals.room(plan.goal)
    sets = len(goal.weights)
    return Room(
        np.zeros((joints, functions)),
        lanes.aligned(5, 1, joints, samples),
        lanes.aligned(5, 1, joints, finer),
        lanes.aligned(joints, finer),
        lanes.room(joints),
        lanes.aligned(size, joints * regressor.SPAN),
        np.zeros((size, size)),
        goal,
        np.zeros((sets, 10 * joints)),
        terms.room(plan.extra, samples, sets),
        lanes.aligned(3, 1, joints, samples),
        lanes.aligned(len(plan.fine), 1, joints, finer),
        apart.room(len(plan.shapes.frame), joints),
        np.zeros((joints, functions)),
    )


@kernel
def _move(plan: Plan, x: Array, work: Room) -> None:
    """Write the coefficients (J, K) [rad/s] of a point (J, K), and the states."""
    for j in range(len(x)):
        for k in range(x.shape[1]):
            work.c[j, k] = product(plan.matrix[j, k], x[j], x.shape[1])
    roll_out(plan, work)


@kernel
def roll_out(plan: Plan, work: Room) -> None:
    """Write the states of the coefficients at both grids of samples."""
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
    bounds, fine, push, total = plan.limits, work.fine, work.push, 0.0
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
            add_to(gradient[j], work.back[j, k], plan.matrix[j, k], functions)


@kernel
def _penalised(plan: Plan, count: int, gradient: Array, work: Room) -> float:
    """Penalty of the states; writes the gradient of it and of the energy of so many directions."""
    columns, first, samples = plan.columns, plan.columns.first, work.states.shape[3]
    for k in range(count):
        work.goal.weights[k] /= samples
        for i in range(len(plan.home)):
            for m in range(first[i], first[i + 1]):
                work.sets[k, 10 * i + columns.kinds[m]] = work.goal.base[k, m]
        for e in range(len(plan.extra.kinds)):
            work.signals.shares[k, e] = work.goal.base[k, len(columns.kinds) + e]
    directions, extra = (work.sets, work.goal.weights[:count]), (plan.extra, work.signals)
    cost = weighted_slopes(
        plan.chain, plan.limits, work.states, extra, plan.roots, directions, work.slope, work.lanes
    )
    cost += _bound(plan, work)
    cost += apart.keep_apart(plan.chain, plan.shapes, work.fine, plan.close, plan.reach, work.push, work.near)
    _pull_back(plan, gradient, work)
    return cost


@kernel
def objective(plan: Plan, x: Array, gradient: Array, work: Room) -> tuple[float, float]:
    """Goal and penalty of a point (J, K); writes the gradient of their sum, (J, K).

    Where there is no goal it is infinite, and the gradient zero.
    """
    _move(plan, x, work)
    extra = plan.extra, work.signals
    weighted_gram(plan.chain, work.states, plan.columns, extra, plan.roots, work.gram, work.lanes, work.y)
    value, count = goals.goal_of(plan.goal, plan.subspace, work.gram, work.goal)
    for j in range(len(gradient)):
        clear(gradient[j])
    if not math.isfinite(value):
        return np.inf, 0.0
    return value, _penalised(plan, count, gradient, work)


@kernel
def pull_back(plan: Plan, x: Array, vectors: Array, weights: Array, gradient: Array, work: Room) -> float:
    """Penalty of a point (J, K); writes the gradient of it and of Σ weight · |Y v|² / T, (J, K).

    The vectors v are (D, p), of rigid bodies alone; their rows count by the joints' weights.
    """
    _move(plan, x, work)
    for k in range(len(weights)):
        work.goal.weights[k] = weights[k]
        for m in range(vectors.shape[1]):
            work.goal.base[k, m] = vectors[k, m]
    return _penalised(plan, len(weights), gradient, work)
