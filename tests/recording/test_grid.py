import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.recording.grid import derivative, low_pass, runs


def signal(time):
    return np.stack([np.sin(2 * time), np.cos(3 * time)], 1)


def stamps(count=400, seed=0):
    rng = np.random.default_rng(seed)
    return np.arange(count) * 0.01 + rng.uniform(-0.003, 0.003, count)


@settings(max_examples=30)
@given(st.integers(10, 380), st.integers(0, 20))
def test_the_grid_is_uniform_and_crosses_no_gap(at, duplicates):
    time = stamps()
    time[at:] += 1.0
    once, again = (
        [(run.grid(0, run.points), run.at([signal(t)], 0, run.points)) for run in runs(t, 0.01, 0.1)]
        for t in (time, np.sort([*time, *time[:duplicates]]))
    )
    assert len(once) == len(again) == 2
    for (grid, x), (same, y), ends in zip(once, again, (time[:at], time[at:])):
        assert grid[0] == ends[0] and ends[-1] - 0.01 < grid[-1] <= ends[-1] + 1e-9
        np.testing.assert_array_equal(grid, same)
        np.testing.assert_array_equal(x, y)
        np.testing.assert_allclose(np.diff(grid), 0.01, atol=1e-12)
        np.testing.assert_allclose(x, signal(grid), atol=5e-4)


def test_the_low_pass_filter_does_not_shift_slow_signals():
    time = np.arange(2000) * 0.01
    slow, fast = np.sin(2 * np.pi * 0.3 * time)[:, None], np.sin(2 * np.pi * 20 * time)[:, None]
    resampled = low_pass(slow + fast, 5.0, 0.01)[200:-200]
    np.testing.assert_allclose(resampled, slow[200:-200], atol=1e-4)


@pytest.mark.parametrize("power", [1, 2, 3])
def test_derivatives_of_polynomials_are_exact_inside(power):
    time, inside = np.arange(50)[:, None] * 0.1, slice(2, -2)
    expected = power * time ** (power - 1)
    np.testing.assert_allclose(derivative(time**power, 0.1)[inside], expected[inside], atol=1e-10)
