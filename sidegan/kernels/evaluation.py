"""Fitness and worst margins of trajectories at their samples: what an optimiser without gradients asks."""

import math
from typing import NamedTuple

import numpy as np

from sidegan.kernels import apart, eigen, lanes, plans
from sidegan.kernels.chain import Array
from sidegan.kernels.goals import to_orthonormal
from sidegan.kernels.jit import kernel
from sidegan.kernels.lanes import DDQ, DQ, Q
from sidegan.kernels.signals import combine, within
from sidegan.kernels.weighted import weighted_gram

# Numbers of a trajectory.
FITNESS, POSITION, VELOCITY, TORQUE, COLLISION, KEEP_OUT, ACCELERATION, JERK, NUMBERS = range(9)
_EPS = float(np.finfo(np.float64).eps)


class Measure(NamedTuple):
    """What the numbers mean."""

    diagonal: bool  # diagonal fitness instead of the eigenvalue fitness
    weakest: int  # rank, from the smallest, of the eigenvalue that the largest is divided by
    hopeless: float  # stands for an infinite fitness
    distance: float  # clearance that counts like a whole limit [m]
    higher: Array  # limits of acceleration and jerk, (2, J); (2, 0) where there are none
    parameters: Array  # inertial parameters, (1, 1, 10 J)


class Room(NamedTuple):
    """Room for the kernel at work beside that of the plan; not to be shared among threads."""

    ends: Array  # smallest and largest eigenvalue, (2,)
    rows: Array  # of ``eigen``
    shifts: Array  # of ``eigen``


def room(plan: plans.Plan) -> Room:
    """Room to evaluate trajectories of a plan."""
    return Room(np.zeros(2), *eigen.room(len(plan.subspace), 2))


@kernel
def _limits(plan: plans.Plan, measure: Measure, numbers: Array, work: plans.Room) -> None:
    """Write the violations of positions, velocities, torques and higher derivatives."""
    middle, most, torque = plan.limits.middle, plan.limits.torque, work.slope[:1]
    limited = False
    for j in range(len(most)):
        limited |= math.isfinite(most[j])
    if limited:
        lanes.torques(plan.chain, work.states, measure.parameters, torque, work.lanes)
    for j in range(len(most)):
        q, room = work.fine[Q, 0, j], plan.limits.room[j]
        for n in range(len(q) if math.isfinite(room) else 0):
            numbers[POSITION] = max(numbers[POSITION], abs(q[n] - middle[j]) / room - 1.0)
        numbers[POSITION] = max(numbers[POSITION], -1.0)
        numbers[VELOCITY] = max(numbers[VELOCITY], -within(work.fine[DQ, 0, j], plan.limits.speed[j]))
        if limited:
            numbers[TORQUE] = max(numbers[TORQUE], -within(torque[0, 0, j], most[j]))
    for j in range(measure.higher.shape[1]):
        numbers[ACCELERATION] = max(
            numbers[ACCELERATION], -within(work.states[DDQ, 0, j], measure.higher[0, j])
        )
        lanes.clear(work.line[j])
    if measure.higher.shape[1] > 0:
        combine(work.c, plan.fine[len(plan.fine) - 1], 0, work.line.shape[1], work.line, 0)
    for j in range(measure.higher.shape[1]):
        numbers[JERK] = max(numbers[JERK], -within(work.line[j], measure.higher[1, j]))


@kernel
def _distances(plan: plans.Plan, distance: float, numbers: Array, work: plans.Room) -> None:
    """Write the violations of distances."""
    shapes, samples, near, clear = plan.shapes, work.fine.shape[3], np.inf, np.inf
    if len(shapes.pairs) + len(shapes.guarded) == 0:
        return
    step = lanes.step_of(samples)
    for start in range(0, samples, step):
        span, push = (start, min(step, samples - start)), work.push[0, 0]
        apart.place(plan.chain, shapes, work.fine, span, work.near)
        near = apart.pairs(plan.chain, shapes, span, (near, 0.0), push, work.near)[1]
        clear = apart.regions(plan.chain, shapes, span, (clear, 0.0), push, work.near)[1]
    numbers[COLLISION], numbers[KEEP_OUT] = -near / distance, -clear / distance


@kernel
def _ratio(plan: plans.Plan, measure: Measure, work: plans.Room, room: Room) -> float:
    """Largest over smallest eigenvalue or diagonal element of YᵀY; infinite where that is rounding."""
    extra, size = (plan.extra, work.signals), len(plan.subspace)
    weighted_gram(plan.chain, work.states, plan.columns, extra, plan.roots, work.gram, work.lanes, work.y)
    if measure.diagonal:
        low, high = np.inf, 0.0
        for p in range(size):
            low, high = min(low, work.gram[p, p]), max(high, work.gram[p, p])
        return high / low if low > _EPS * high else np.inf
    inner = work.goal.inner
    scale = to_orthonormal(plan.subspace, work.gram, work.goal.product, inner)
    if not (math.isfinite(scale) and scale > 0):
        return np.inf
    for i in range(size):
        for j in range(size):
            inner[i, j] /= scale
    eigen.ends(inner, measure.weakest, room.ends, room.rows, room.shifts)
    low, high = room.ends[0], room.ends[1]
    return high / low if low > size * _EPS * high else np.inf


@kernel
def evaluate(
    plan: plans.Plan, measure: Measure, c: Array, numbers: Array, work: plans.Room, room: Room
) -> None:
    """Write log fitness and violations, (B, NUMBERS), of trajectories with coefficients (B, J, K) [rad/s].

    A violation is the worst relative margin with its sign turned: positive where the constraint is violated.
    Both grids of the plan have the same samples.
    """
    for b in range(len(c)):
        for n in range(NUMBERS):
            numbers[b, n] = -np.inf
        for j in range(c.shape[1]):
            for k in range(c.shape[2]):
                work.c[j, k] = c[b, j, k]
        plans.roll_out(plan, work)
        _limits(plan, measure, numbers[b], work)
        _distances(plan, measure.distance, numbers[b], work)
        ratio = _ratio(plan, measure, work, room)
        numbers[b, FITNESS] = math.log(ratio if ratio < measure.hopeless else measure.hopeless)
