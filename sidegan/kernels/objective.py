"""Compiled penalised objective of one trajectory, its exact gradient, and its worst margins."""

import math
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array
from sidegan.kernels import HOPELESS, apart, dynamics, eigen, goals, information, regressor
from sidegan.kernels.apart import keep_apart
from sidegan.kernels.chain import Chain, Shapes
from sidegan.kernels.dynamics import COS, DDQ, DQ, SIN, PenaltyLimits, Q, clear, limit_excess
from sidegan.kernels.eigen import add_to, product
from sidegan.kernels.goals import goal_of, to_orthonormal
from sidegan.kernels.information import weighted_grams, weighted_slopes
from sidegan.kernels.jit import kernel, part


class Plan(NamedTuple):
    """An arm in its workspace, the trajectory parametrisation, limits and goal.

    A point x, (J, K), has the coefficients matrix[j] @ x[j] for joint j.
    """

    chain: Chain
    shapes: Shapes
    columns: regressor.Columns  # base columns, ascending
    extra: information.JointTerms  # rotor, friction and offset terms; their parameters follow the base's
    # lower triangular C of all P parameters; Cᵀ YᵀY C has the spectrum in an orthonormal basis, (P, P)
    subspace: Array
    home: Array  # start position of the trajectories, (J,) [rad or m]
    matrix: Array  # maps points to coefficients, (J, K, K), symmetric
    basis: Array  # derivatives 0 to 2 of the K basis functions at T samples, (3, K, T)
    # derivatives 0, 1 and those that ``higher`` limits, at S finer samples that include the T, (2 + L, K, S)
    fine: Array
    limits: PenaltyLimits  # for torques at the T samples, for everything else at the finer ones
    higher: Array  # limits on acceleration, jerk, …, (L, J); infinite where unlimited
    box: float  # bound on absolute coefficients; infinite if there is none
    close: float  # weight of squared distance shortfalls, at the finer samples [1/m²]
    reach: float  # distance below which the penalty starts [m]
    goal: goals.GoalArrays


class PlanBuffers(NamedTuple):
    """Scratch arrays of one thread."""

    c: Array  # coefficients, (J, K)
    states: Array  # (5, 1, J, T)
    fine: Array  # states at the finer samples, without accelerations, (4, J, S)
    line: Array  # one derivative at the finer samples, (J, S)
    lanes: dynamics.DynamicsBuffers
    y: Array  # regressor
    gram: Array  # (1, P, P)
    goal: goals.GoalBuffers
    sets: Array  # inertial parameters of the directions, (D, 10 J)
    signals: information.Signals
    slope: Array  # gradient in positions, velocities and accelerations, (3, J, T)
    push: Array  # gradient in the derivatives limited at the finer samples, (2 + L, J, S)
    near: apart.DistanceBuffers
    back: Array  # gradient in the coefficients, (J, K)
    ends: Array  # smallest and largest eigenvalue, (2,)


def plan_buffers(plan: Plan) -> PlanBuffers:
    """Scratch arrays for a plan, or any other of the same dimensions."""
    joints, functions, _ = plan.matrix.shape
    size, samples, finer = len(plan.subspace), plan.basis.shape[2], plan.fine.shape[2]
    goal = goals.goal_buffers(plan.goal)
    sets = len(goal.weights)
    return PlanBuffers(
        np.zeros((joints, functions)),
        dynamics.aligned(5, 1, joints, samples),
        dynamics.aligned(4, joints, finer),
        dynamics.aligned(joints, finer),
        dynamics.dynamics_buffers(plan.chain),
        dynamics.aligned(size, joints * regressor.SPAN),
        np.zeros((1, size, size)),
        goal,
        np.zeros((sets, 10 * joints)),
        information.signals_for(plan.extra, samples, sets),
        dynamics.aligned(3, joints, samples),
        dynamics.aligned(len(plan.fine), joints, finer),
        apart.distance_buffers(len(plan.shapes.frame), joints),
        np.zeros((joints, functions)),
        np.zeros(2),
    )


@kernel
def _combine(c: Array, basis: Array, out: Array) -> None:
    """Add combinations of basis functions (K, T) with coefficients (J, K) to signals (J, T).

    Each basis function is read once for all joints.
    """
    for k in range(len(basis)):
        for j in range(len(c)):
            factor, line, function = c[j, k], out[j], basis[k]
            for n in range(len(line)):
                line[n] += factor * function[n]


@kernel
def _move(plan: Plan, x: Array, work: PlanBuffers) -> None:
    """Write the coefficients (J, K) [rad/s] and the states of a point (J, K)."""
    for j in range(len(x)):
        for k in range(x.shape[1]):
            work.c[j, k] = product(plan.matrix[j, k], x[j], x.shape[1])
    roll_out(plan, work)


@kernel
def roll_out(plan: Plan, work: PlanBuffers) -> None:
    """Write the states that the coefficients give on both sample grids."""
    fine, states = work.fine, work.states
    joints, samples, finer = len(plan.home), states.shape[3], fine.shape[2]
    every = finer // samples
    for j in range(joints):
        for n in range(finer):
            fine[Q, j, n], fine[DQ, j, n] = plan.home[j], 0.0
        clear(states[DDQ, 0, j])
    _combine(work.c, plan.fine[0], fine[Q])
    _combine(work.c, plan.fine[1], fine[DQ])
    _combine(work.c, plan.basis[2], states[DDQ, 0])
    for j in range(joints):
        for n in range(finer):
            fine[SIN, j, n] = math.sin(fine[Q, j, n])
            fine[COS, j, n] = math.cos(fine[Q, j, n])
        for n in range(samples):
            at = every * n + every // 2
            for r in range(len(fine)):
                states[r, 0, j, n] = fine[r, j, at]


@kernel
def _cost_of(x: Array, middle: float, limit: float, reserve: float, weight: float, slope: Array) -> float:
    """Penalty of a signal for leaving its range; writes its gradient."""
    total = 0.0
    for n in range(len(x)):
        excess = limit_excess(x[n] - middle, limit, reserve)
        slope[n] = 2.0 * weight / limit * excess
        total += excess * excess
    return weight * total


@kernel
def _bound(plan: Plan, work: PlanBuffers) -> float:
    """Penalty of positions, velocities and higher derivatives; writes its gradient."""
    bounds, fine, push, total = plan.limits, work.fine, work.push, 0.0
    weight, reserve = bounds.weight, bounds.reserve
    for j in range(len(bounds.room)):
        total += _cost_of(fine[Q, j], bounds.middle[j], bounds.room[j], reserve, weight, push[0, j])
        total += _cost_of(fine[DQ, j], 0.0, bounds.speed[j], reserve, weight, push[1, j])
    for r in range(len(plan.higher)):
        for j in range(len(work.line)):
            clear(work.line[j])
        _combine(work.c, plan.fine[2 + r], work.line)
        for j in range(len(work.line)):
            total += _cost_of(work.line[j], 0.0, plan.higher[r, j], reserve, weight, push[2 + r, j])
    return total


@kernel
def _keep_in_box(plan: Plan, work: PlanBuffers) -> float:
    """Penalty of coefficients outside the box; writes its gradient."""
    weight, reserve, total = plan.limits.weight, plan.limits.reserve, 0.0
    for j in range(len(work.c)):
        total += _cost_of(work.c[j], 0.0, plan.box, reserve, weight, work.back[j])
    return total


@kernel
def _pull_back(plan: Plan, gradient: Array, work: PlanBuffers) -> None:
    """Propagate the gradients on both sample grids, and that in the coefficients, back to the point."""
    joints, functions = work.back.shape
    samples, finer = work.states.shape[3], work.fine.shape[2]
    for j in range(joints):
        for k in range(functions):
            total = work.back[j, k]
            for r in range(3):
                total += product(work.slope[r, j], plan.basis[r, k], samples)
            for r in range(len(plan.fine)):
                total += product(work.push[r, j], plan.fine[r, k], finer)
            work.back[j, k] = total
    for j in range(joints):
        clear(gradient[j])
        for k in range(functions):
            add_to(gradient[j], work.back[j, k], plan.matrix[j, k], functions)


@kernel
def slopes(plan: Plan, count: int, work: PlanBuffers) -> float:
    """Torque penalty; writes the gradient of it plus the energy of ``count`` directions in the states."""
    directions, extra = (work.sets, work.goal.weights[:count]), (plan.extra, work.signals)
    return weighted_slopes(plan.chain, plan.limits, work.states, extra, directions, work.slope, work.lanes)


@part
def _penalised(plan: Plan, count: int, gradient: Array, work: PlanBuffers) -> float:
    """Penalty of the states; writes the gradient of it plus the energy of ``count`` directions."""
    columns, first, samples = plan.columns, plan.columns.first, work.states.shape[3]
    for k in range(count):
        work.goal.weights[k] /= samples
        for i in range(len(plan.home)):
            for m in range(first[i], first[i + 1]):
                work.sets[k, 10 * i + columns.kinds[m]] = work.goal.base[k, m]
        for e in range(len(plan.extra.kinds)):
            work.signals.shares[k, e] = work.goal.base[k, len(columns.kinds) + e]
    cost = slopes(plan, count, work) + _bound(plan, work) + _keep_in_box(plan, work)
    if plan.close > 0:
        reach, weight, push = plan.reach, plan.close, work.push[0]
        cost += keep_apart(plan.chain, plan.shapes, work.fine, reach, weight, push, work.near)[0]
    _pull_back(plan, gradient, work)
    return cost


@part
def objective_of(plan: Plan, x: Array, gradient: Array, work: PlanBuffers) -> tuple[float, float]:
    """Goal and penalty of a point (J, K); writes the gradient of their sum, (J, K).

    Where the goal is not finite, it is infinite and the gradient and the penalty are zero.
    """
    _move(plan, x, work)
    extra = plan.extra, work.signals
    weighted_grams(plan.chain, work.states, plan.columns, extra, work.gram, work.lanes, work.y)
    value, count = goal_of(plan.goal, plan.subspace, work.gram[0], work.goal)
    for j in range(len(gradient)):
        clear(gradient[j])
    if not math.isfinite(value):
        return np.inf, 0.0
    return value, _penalised(plan, count, gradient, work)


@kernel
def energy_gradient(
    plan: Plan, x: Array, vectors: Array, weights: Array, gradient: Array, work: PlanBuffers
) -> float:
    """Penalty of a point (J, K); writes the gradient of it plus Σ weight · |Y v|² / T, (J, K).

    The vectors v, (D, p), hold rigid-body parameters only; joint weights apply to the rows of Y.
    """
    _move(plan, x, work)
    for k in range(len(weights)):
        work.goal.weights[k] = weights[k]
        for m in range(vectors.shape[1]):
            work.goal.base[k, m] = vectors[k, m]
    return _penalised(plan, len(weights), gradient, work)


# Columns of a trajectory's numbers.
FITNESS, POSITION, VELOCITY, TORQUE, COLLISION, KEEP_OUT, ACCELERATION, JERK, NUMBERS = range(9)
_EPS = float(np.finfo(np.float64).eps)


@kernel
def _beyond_most(x: Array, middle: float, limit: float) -> float:
    """Largest excess of a signal over its limit, relative to the limit; negative if it never exceeds it."""
    most = 0.0
    for n in range(len(x) if math.isfinite(limit) else 0):
        most = max(most, abs(x[n] - middle))
    return most / limit - 1.0


@kernel
def _limits(plan: Plan, numbers: Array, work: PlanBuffers) -> None:
    """Write the violations of positions, velocities, torques and higher derivatives."""
    limits, torque = plan.limits, work.slope[0]
    limited = False
    for j in range(len(plan.home)):
        limited |= math.isfinite(limits.torque[j])
    if limited:
        dynamics.inverse_dynamics(plan.chain, work.states, limits.parameters, torque, work.lanes)
        for j in range(len(plan.home)):
            for n in range(len(torque[j])):
                own = limits.viscous[j] * work.states[DQ, 0, j, n]
                torque[j, n] += own + limits.rotor[j] * work.states[DDQ, 0, j, n]
    if len(plan.higher) > 0:
        for j in range(len(plan.home)):
            clear(work.line[j])
        _combine(work.c, plan.fine[3], work.line)
    for j in range(len(plan.home)):
        position = _beyond_most(work.fine[Q, j], limits.middle[j], limits.room[j])
        numbers[POSITION] = max(numbers[POSITION], position)
        numbers[VELOCITY] = max(numbers[VELOCITY], _beyond_most(work.fine[DQ, j], 0.0, limits.speed[j]))
        if limited:
            numbers[TORQUE] = max(numbers[TORQUE], _beyond_most(torque[j], 0.0, limits.torque[j]))
        if len(plan.higher) > 0:
            acceleration = _beyond_most(work.states[DDQ, 0, j], 0.0, plan.higher[0, j])
            numbers[ACCELERATION] = max(numbers[ACCELERATION], acceleration)
            numbers[JERK] = max(numbers[JERK], _beyond_most(work.line[j], 0.0, plan.higher[1, j]))


@kernel
def _ratio(plan: Plan, weakest: int, work: PlanBuffers) -> float:
    """Largest eigenvalue of YᵀWY over that of ascending rank ``weakest``; infinite if that is noise."""
    extra, size = (plan.extra, work.signals), len(plan.subspace)
    weighted_grams(plan.chain, work.states, plan.columns, extra, work.gram, work.lanes, work.y)
    inner = work.goal.inner
    scale = to_orthonormal(plan.subspace, work.gram[0], work.goal.square, inner)
    if not (math.isfinite(scale) and scale > 0):
        return np.inf
    for i in range(size):
        for j in range(size):
            inner[i, j] /= scale
    eigen.extreme_eigenvalues(inner, weakest, work.ends, work.goal.rows, work.goal.shifts)
    low, high = work.ends[0], work.ends[1]
    return high / low if low > size * _EPS * high else np.inf


@kernel
def evaluate(plan: Plan, weakest: int, c: Array, numbers: Array, work: PlanBuffers) -> None:
    """Write log fitness and violations, (B, NUMBERS), of trajectories with coefficients (B, J, K) [rad/s].

    Fitness is the ratio of the largest eigenvalue of YᵀWY to that of ascending rank ``weakest``. A violation
    is the negated worst relative margin, in metres for distances: positive where the constraint is violated.
    Both sample grids of the plan must be the same.
    """
    for b in range(len(c)):
        for n in range(NUMBERS):
            numbers[b, n] = -np.inf
        for j in range(c.shape[1]):
            for k in range(c.shape[2]):
                work.c[j, k] = c[b, j, k]
        roll_out(plan, work)
        _limits(plan, numbers[b], work)
        found = keep_apart(plan.chain, plan.shapes, work.fine, np.inf, 0.0, work.push[0], work.near)
        numbers[b, COLLISION], numbers[b, KEEP_OUT] = -found[1], -found[2]
        ratio = _ratio(plan, weakest, work)
        numbers[b, FITNESS] = math.log(ratio if ratio < HOPELESS else HOPELESS)
