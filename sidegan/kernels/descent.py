"""L-BFGS with backtracking on one plan, compiled.

Source: Nocedal and Wright 2006, algorithm 7.5.
"""

import math
from typing import NamedTuple

import numpy as np

from sidegan.kernels import plans
from sidegan.kernels.chain import Array
from sidegan.kernels.jit import kernel
from sidegan.kernels.matrices import add_to, product

# Numbers of a search.
GOAL, COST, LENGTH, USED, HEAD, STARTED, NUMBERS = range(7)


class Rules(NamedTuple):
    """How the search goes on."""

    step: float  # longest first step, in the norm of x
    armijo: float
    shrink: float  # of a step that is refused
    curvature: float  # pairs below this relative curvature are not stored
    shortest: float  # a shorter step begins anew


class Search(NamedTuple):
    """Where a search is; written by it. Points are (J, K)."""

    x: Array
    gradient: Array
    direction: Array
    trial: Array
    slope: Array  # the gradient there
    s: Array  # steps, (memory + 1, J K): one is room for a step that may not be kept
    y: Array  # what they changed of the gradient
    rho: Array  # (memory + 1,)
    alpha: Array  # (memory + 1,)
    numbers: Array  # (NUMBERS,)


def search(joints: int, functions: int, memory: int) -> Search:
    """Room for a search that has not begun."""
    point, pairs = (joints, functions), (memory + 1, joints * functions)
    shapes: dict[str, tuple[int, ...]] = {}
    shapes |= {"x": point, "gradient": point, "direction": point, "trial": point, "slope": point}
    shapes |= {"s": pairs, "y": pairs, "rho": pairs[:1], "alpha": pairs[:1], "numbers": (NUMBERS,)}
    return Search(**{name: np.zeros(shape) for name, shape in shapes.items()})


@kernel
def _dot(x: Array, y: Array) -> float:
    total = 0.0
    for j in range(len(x)):
        total += product(x[j], y[j], x.shape[1])
    return total


@kernel
def _begin_anew(rules: Rules, state: Search) -> None:
    """Steepest descent, with nothing remembered."""
    state.numbers[USED] = 0.0
    state.numbers[LENGTH] = 1.0
    factor = -rules.step / max(math.sqrt(_dot(state.gradient, state.gradient)), 1e-12)
    for j in range(len(state.x)):
        for k in range(state.x.shape[1]):
            state.direction[j, k] = factor * state.gradient[j, k]


@kernel
def _remember(rules: Rules, state: Search) -> None:
    """Keep a step and what it changed, where the curvature is worth it."""
    head = (int(state.numbers[HEAD]) + 1) % len(state.rho)
    s, y, functions = state.s[head], state.y[head], state.x.shape[1]
    for j in range(len(state.x)):
        for k in range(functions):
            s[j * functions + k] = state.trial[j, k] - state.x[j, k]
            y[j * functions + k] = state.slope[j, k] - state.gradient[j, k]
    size = len(s)
    sy, ss, yy = product(s, y, size), product(s, s, size), product(y, y, size)
    if sy > rules.curvature * math.sqrt(ss * yy):
        state.numbers[HEAD] = head
        state.numbers[USED] = min(state.numbers[USED] + 1, len(state.rho) - 1)
        state.rho[head] = 1 / sy


@kernel
def _two_loops(rules: Rules, state: Search) -> None:
    """The direction that the remembered steps give. Source: Nocedal and Wright 2006, algorithm 7.4."""
    joints, functions = state.x.shape
    d, slots = state.direction, len(state.rho)
    head, used = int(state.numbers[HEAD]), int(state.numbers[USED])
    for j in range(joints):
        for k in range(functions):
            d[j, k] = -state.gradient[j, k]
    for m in range(used):
        at = (head - m) % slots
        total = 0.0
        for j in range(joints):
            total += product(state.s[at][j * functions : (j + 1) * functions], d[j], functions)
        state.alpha[at] = state.rho[at] * total
        for j in range(joints):
            add_to(d[j], -state.alpha[at], state.y[at][j * functions : (j + 1) * functions], functions)
    y = state.y[head]
    scale = 1 / max(state.rho[head] * product(y, y, len(y)), 1e-300)
    for j in range(joints):
        for k in range(functions):
            d[j, k] *= scale
    for m in range(used - 1, -1, -1):
        at = (head - m) % slots
        total = 0.0
        for j in range(joints):
            total += product(state.y[at][j * functions : (j + 1) * functions], d[j], functions)
        change = state.alpha[at] - state.rho[at] * total
        for j in range(joints):
            add_to(d[j], change, state.s[at][j * functions : (j + 1) * functions], functions)
    factor = min(1.0, 4 * rules.step / max(math.sqrt(_dot(d, d)), 1e-12))
    for j in range(joints):
        for k in range(functions):
            d[j, k] *= factor


@kernel
def _try(state: Search) -> float:
    """Write the next trial; the slope along the step."""
    length, slope = state.numbers[LENGTH], 0.0
    for j in range(len(state.x)):
        slope += product(state.direction[j], state.gradient[j], state.x.shape[1])
        for k in range(state.x.shape[1]):
            state.trial[j, k] = state.x[j, k] + length * state.direction[j, k]
    return length * slope


@kernel
def _accept(state: Search, goal: float, cost: float) -> None:
    """Go where the trial is."""
    numbers = state.numbers
    for j in range(len(state.x)):
        for k in range(state.x.shape[1]):
            state.x[j, k], state.gradient[j, k] = state.trial[j, k], state.slope[j, k]
    numbers[GOAL], numbers[COST], numbers[LENGTH] = goal, cost, 1.0


@kernel
def _judge(rules: Rules, state: Search, expected: float, goal: float, cost: float) -> None:
    """Accept or refuse the trial, and choose the next direction."""
    numbers = state.numbers
    enough = numbers[GOAL] + numbers[COST] + rules.armijo * expected
    if not (goal + cost <= enough and math.isfinite(_dot(state.slope, state.slope))):
        if numbers[LENGTH] < rules.shortest:
            _begin_anew(rules, state)
        else:
            numbers[LENGTH] *= rules.shrink
        return
    _remember(rules, state)
    _accept(state, goal, cost)
    if numbers[USED] > 0:
        _two_loops(rules, state)
    if not (numbers[USED] > 0 and _dot(state.direction, state.gradient) < 0):
        _begin_anew(rules, state)


@kernel
def descend(plan: plans.Plan, rules: Rules, state: Search, work: plans.Room, evaluations: int) -> None:
    """So many evaluations; the first of a search that has not begun is that of its start."""
    for _ in range(evaluations):
        fresh = state.numbers[STARTED] == 0
        if fresh:
            state.numbers[LENGTH] = 0.0
        expected = _try(state)
        goal, cost = plans.objective(plan, state.trial, state.slope, work)
        if fresh:
            _accept(state, goal, cost)
            _begin_anew(rules, state)
            state.numbers[STARTED] = 1.0
        else:
            _judge(rules, state, expected, goal, cost)
