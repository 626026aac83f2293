"""Numerics of kernels: eigenpairs against LAPACK, L-BFGS against dense updates, sine and cosine."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.kernels import descent, eigen
from sidegan.kernels.links import waves
from tests.motion.conftest import normal

LOW, HIGH = 3, 2  # eigenpairs at either end


def symmetric(spectrum, seed):
    size = len(spectrum)
    turn = np.linalg.qr(normal(size, size, seed=seed))[0]
    x = (turn * np.array(spectrum, dtype=float)) @ turn.T
    return (x + x.T) / 2


def check(x, alone=False):
    """Values are LAPACK's; the vectors are eigenvectors, of length one and at right angles.

    Where pairs are not accurate enough the kernel says so, unless it has to do it alone.
    """
    size, count = len(x), LOW + HIGH
    x = x / max(float(np.abs(x).max()), 1e-300)
    values, vectors = np.zeros(count), np.zeros((count, size))
    sound = eigen.extreme_eigenpairs(x.copy(), LOW, values, vectors, *eigen.eigen_buffers(size, count))
    assert sound or not alone
    if sound:
        expected = np.linalg.eigvalsh(x)[[*range(LOW), *range(size - HIGH, size)]]
        np.testing.assert_allclose(values, expected, rtol=0, atol=1e-14 * size)
        assert np.abs(x @ vectors.T - vectors.T * values).max() < 1e-13 * size
        np.testing.assert_allclose(vectors @ vectors.T, np.eye(count), rtol=0, atol=1e-8)


spectra = st.lists(st.floats(-1e3, 1e3), min_size=6, max_size=45)
decades = st.builds(lambda size, last: np.logspace(0, -last, size), st.integers(6, 45), st.integers(1, 12))


@settings(max_examples=40)
@given(spectra | decades, st.integers(0, 100))
def test_extreme_eigenvalues_agree_with_lapack(spectrum, seed):
    check(symmetric(spectrum, seed))


@pytest.mark.parametrize(
    "x",
    [
        *(symmetric(spectrum, 0) for spectrum in ([0.0] * 9, [1.0] * 9, [0.0, 0, 0, 1, 1, 2, 2])),
        np.diag(np.arange(9.0)),
        np.zeros((8, 8)),
        1e150 * symmetric(range(1, 10), 1),
        1e-150 * symmetric(range(1, 10), 1),
    ],
)
def test_equal_eigenvalues_and_special_matrices(x):
    check(x)


def test_well_separated_eigenvalues_need_no_second_pass():
    """That is what makes it fast: what is not accurate enough takes all eigenpairs."""
    for seed in range(20):
        check(symmetric(range(30), seed), alone=True)
    for k in range(9):  # each in each place
        check(np.diag(np.roll(np.arange(9.0), k)), alone=True)


def test_the_direction_uses_the_newest_steps_of_positive_curvature(memory=3):
    """Against dense updates of BFGS, on a quadratic."""
    curvatures = np.array([1.0, 4.0, 9.0, 2.0, 3.0, 5.0])
    state, random, kept, eye = descent.descent_state(2, 3, memory), np.random.default_rng(0), [], np.eye(6)
    for curvature in np.outer([*6 * [1], -1, 1, -1], curvatures):
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


@pytest.mark.parametrize("largest", [1e-8, 1.0, 10.0, 1e3, 1e6])
def test_sine_and_cosine_are_accurate_to_the_last_digits(largest):
    x = np.random.default_rng(0).uniform(-largest, largest, 20_001)
    x[:9] = np.pi / 4 * np.arange(-4, 5)  # where quarters begin and end
    sine, cosine = np.empty_like(x), np.empty_like(x)
    waves(x, sine, cosine)
    exact = x.astype(np.longdouble)
    for found, expected in ((sine, np.sin(exact)), (cosine, np.cos(exact))):
        assert np.abs(found - expected).max() <= 2 * 2.0**-53


def test_sine_and_cosine_of_non_finite_numbers_are_nan():
    sine, cosine = np.empty(3), np.empty(3)
    waves(np.array([np.nan, np.inf, -np.inf]), sine, cosine)
    assert np.isnan(sine).all() and np.isnan(cosine).all()
