"""What compiled L-BFGS remembers of its way."""

import numpy as np

from sidegan.kernels import descent

RULES = descent.Rules(step=0.3, armijo=1e-4, shrink=0.3, curvature=1e-10, shortest=1e-6)
CURVATURE = np.array([1.0, 4.0, 9.0, 2.0, 3.0, 5.0])  # of a quadratic


def step_to(state, trial, slope):
    """Remember a step from where the search is, and go there."""
    state.trial[:], state.slope[:] = trial, slope
    descent._remember(RULES, state)
    state.x[:], state.gradient[:] = trial, slope


def test_a_step_that_is_not_kept_leaves_what_is_remembered(memory=3):
    state, random = descent.search(2, 3, memory), np.random.default_rng(0)
    for _ in range(memory + 2):
        trial = random.normal(size=6)
        step_to(state, trial, CURVATURE * trial)
    state.gradient[:] = 1.0
    descent._two_loops(RULES, state)
    before = state.direction.copy()
    assert state.numbers[descent.USED] == memory
    bent = random.normal(size=6)
    state.trial[:], state.slope[:] = state.x + bent, state.gradient - bent  # curvature below zero
    descent._remember(RULES, state)
    descent._two_loops(RULES, state)
    np.testing.assert_array_equal(state.direction, before)


def test_as_many_steps_count_as_are_remembered(memory=3):
    """The newest ones alone give the direction that all of a longer way give."""
    random = np.random.default_rng(1)
    points = random.normal(size=(9, 6))
    directions = []
    for first in (0, len(points) - memory - 1):
        state = descent.search(2, 3, memory)
        state.x[:], state.gradient[:] = points[first], CURVATURE * points[first]
        for point in points[first + 1 :]:
            step_to(state, point, CURVATURE * point)
        descent._two_loops(RULES, state)
        directions.append(state.direction.copy())
    np.testing.assert_allclose(*directions, rtol=1e-12)
