"""Steps that compiled L-BFGS remembers, against dense updates of BFGS."""

import numpy as np

from sidegan.kernels import descent

CURVATURE = np.array([1.0, 4.0, 9.0, 2.0, 3.0, 5.0])  # of a quadratic


def test_the_direction_uses_the_newest_steps_of_positive_curvature(memory=3):
    state, random, kept, eye = descent.search(2, 3, memory), np.random.default_rng(0), [], np.eye(6)
    for curvature in (*6 * [CURVATURE], -CURVATURE, CURVATURE, -CURVATURE):
        step = random.normal(size=6)
        state.trial[:], state.slope[:] = state.x + step, state.gradient + curvature * step
        descent.remember(state)
        state.x[:], state.gradient[:] = state.trial, state.slope
        if curvature[0] > 0:
            kept.append((step, curvature * step))
    step, change = kept[-1]
    inverse = step @ change / (change @ change) * eye
    for step, change in kept[-memory:]:
        turn = eye - np.outer(step, change) / (step @ change)
        inverse = turn @ inverse @ turn.T + np.outer(step, step) / (step @ change)
    descent.two_loops(state)
    expected = -inverse @ state.gradient
    expected *= min(1.0, 4 * descent.STEP / np.linalg.norm(expected))
    np.testing.assert_allclose(state.direction, expected, rtol=1e-10)
