"""L-BFGS with backtracking on one plan, compiled.

Source: Nocedal and Wright 2006, algorithm 7.5.
"""

import math
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array
from sidegan.kernels.eigen import add_to, product
from sidegan.kernels.jit import kernel
from sidegan.kernels.objective import Plan, PlanBuffers, objective_of

# Indices into a search's numbers.
GOAL, COST, LENGTH, USED, HEAD, STARTED, NUMBERS = range(7)

STEP = 0.3  # length of a steepest-descent step before backtracking, in the norm of x
_ARMIJO = 1e-4  # required share of the expected decrease
_SHRINK = 0.3  # factor on the length of a rejected step
_CURVATURE = 1e-10  # pairs below this relative curvature are not stored
_SHORTEST = 1e-6  # restart from steepest descent below this relative step length


class DescentState(NamedTuple):
    """State of a search. Points are (J K,), one joint after another."""

    x: Array
    gradient: Array
    direction: Array
    trial: Array
    slope: Array  # gradient at the trial point
    rows: tuple[Array, Array]  # views of trial and slope, (J, K)
    s: Array  # steps, (memory + 1, J K): the extra slot is for a step that may not be kept
    y: Array  # changes of the gradient over these steps
    rho: Array  # 1 / sᵀy, (memory + 1,)
    alpha: Array  # scratch for the two-loop recursion, (memory + 1,)
    numbers: Array  # (NUMBERS,)


def descent_state(joints: int, functions: int, memory: int) -> DescentState:
    """State of a search that has not started."""
    size, slots = joints * functions, memory + 1
    trial, slope = np.zeros(size), np.zeros(size)
    return DescentState(
        x=np.zeros(size),
        gradient=np.zeros(size),
        direction=np.zeros(size),
        trial=trial,
        slope=slope,
        rows=(trial.reshape(joints, functions), slope.reshape(joints, functions)),
        s=np.zeros((slots, size)),
        y=np.zeros((slots, size)),
        rho=np.zeros(slots),
        alpha=np.zeros(slots),
        numbers=np.zeros(NUMBERS),
    )


@kernel
def _length(x: Array) -> float:
    return max(math.sqrt(product(x, x, len(x))), 1e-12)


@kernel
def _begin_anew(state: DescentState) -> None:
    """Start, or restart, from steepest descent with an empty memory."""
    state.numbers[USED] = 0.0
    state.numbers[LENGTH] = 1.0
    factor = -STEP / _length(state.gradient)
    for i in range(len(state.x)):
        state.direction[i] = factor * state.gradient[i]


@kernel
def remember(state: DescentState) -> None:
    """Store the step and its change of the gradient, if the curvature is large enough."""
    head, size = (int(state.numbers[HEAD]) + 1) % len(state.rho), len(state.x)
    s, y = state.s[head], state.y[head]
    for i in range(size):
        s[i] = state.trial[i] - state.x[i]
        y[i] = state.slope[i] - state.gradient[i]
    sy, ss, yy = product(s, y, size), product(s, s, size), product(y, y, size)
    if sy > _CURVATURE * math.sqrt(ss * yy):
        state.numbers[HEAD] = head
        state.numbers[USED] = min(state.numbers[USED] + 1, len(state.rho) - 1)
        state.rho[head] = 1 / sy


@kernel
def two_loops(state: DescentState) -> None:
    """Write the L-BFGS direction. Source: Nocedal and Wright 2006, algorithm 7.4."""
    d, slots, size = state.direction, len(state.rho), len(state.x)
    head, used = int(state.numbers[HEAD]), int(state.numbers[USED])
    for i in range(size):
        d[i] = -state.gradient[i]
    for m in range(used):
        at = (head - m) % slots
        state.alpha[at] = state.rho[at] * product(state.s[at], d, size)
        add_to(d, -state.alpha[at], state.y[at], size)
    scale = 1 / max(state.rho[head] * product(state.y[head], state.y[head], size), 1e-300)
    for i in range(size):
        d[i] *= scale
    for m in range(used - 1, -1, -1):
        at = (head - m) % slots
        add_to(d, state.alpha[at] - state.rho[at] * product(state.y[at], d, size), state.s[at], size)
    factor = min(1.0, 4 * STEP / _length(d))
    for i in range(size):
        d[i] *= factor


@kernel
def _accept(state: DescentState, goal: float, cost: float) -> None:
    """Move to the trial point."""
    for i in range(len(state.x)):
        state.x[i], state.gradient[i] = state.trial[i], state.slope[i]
    state.numbers[GOAL], state.numbers[COST], state.numbers[LENGTH] = goal, cost, 1.0


@kernel
def _judge(state: DescentState, expected: float, goal: float, cost: float) -> None:
    """Accept or reject the trial point, and choose the next direction or step length."""
    numbers, size = state.numbers, len(state.x)
    enough = numbers[GOAL] + numbers[COST] + _ARMIJO * expected
    if not (goal + cost <= enough and math.isfinite(product(state.slope, state.slope, size))):
        if numbers[LENGTH] < _SHORTEST:
            _begin_anew(state)
        else:
            numbers[LENGTH] *= _SHRINK
        return
    remember(state)
    _accept(state, goal, cost)
    if numbers[USED] > 0:
        two_loops(state)
    if not (numbers[USED] > 0 and product(state.direction, state.gradient, size) < 0):
        _begin_anew(state)


@kernel
def descend(plan: Plan, state: DescentState, work: PlanBuffers, evaluations: int) -> None:
    """Run a number of evaluations; a new search spends the first one on its start point."""
    for _ in range(evaluations):
        fresh = state.numbers[STARTED] == 0
        length = 0.0 if fresh else state.numbers[LENGTH]
        for i in range(len(state.x)):
            state.trial[i] = state.x[i] + length * state.direction[i]
        goal, cost = objective_of(plan, state.rows[0], state.rows[1], work)
        if fresh:
            _accept(state, goal, cost)
            _begin_anew(state)
            state.numbers[STARTED] = 1.0
        else:
            expected = length * product(state.direction, state.gradient, len(state.x))
            _judge(state, expected, goal, cost)
