"""Hysteresis by the laws that make it one: what counts is the order of reversals, not their times."""

import numpy as np
import pytest

from sidegan.plant.hysteresis import RADII, lagging

FULL, SHARE = np.array([100.0, 20.0]), 0.01  # N·m of two joints
WEIGHT = SHARE / RADII.sum()


def path(turns, steps=1000):
    """A load from zero by way of these shares of the range, (1, T, 2), and where each is reached."""
    legs = [np.linspace(a, b, steps + 1)[1:] for a, b in zip((0.0, *turns), turns)]
    return np.concatenate([[0.0], *legs])[None, :, None] * FULL, steps * np.arange(1, len(turns) + 1)


def area(load, told):
    """Area of the closed loop that load and told make, (J,), as a share of the range's square."""
    lag = (load - told)[0]
    return np.abs(np.trapezoid(lag, load[0], axis=0)) / FULL**2


@pytest.mark.parametrize("swing", [0.1, 0.2, 0.7, 1.0])
def test_the_loop_area_is_that_of_the_elements_at_any_speed(swing):
    """A stop of radius r holds a parallelogram of area 4 r (A − r) of a swing ±A, none where A is smaller."""
    load, (start, _, end) = path((swing, -swing, swing))
    told = lagging(load, FULL, SHARE)
    expected = WEIGHT * sum(4 * r * max(swing - r, 0) for r in RADII)
    slow = slice(start, end + 1)
    assert area(load[:, slow], told[:, slow]) == pytest.approx([expected] * 2, rel=0.01, abs=1e-12)
    bent = np.linspace(0, 1, 4001) ** 2 * (len(load[0]) - 1)  # the same way, ever faster
    kept = np.unique(np.append(np.round(bent), (start, end, 2 * start))).astype(int)
    np.testing.assert_allclose(lagging(load[:, kept], FULL, SHARE), told[:, kept], rtol=0, atol=1e-9)


def test_a_larger_swing_erases_the_memory_of_smaller_ones():
    direct, _ = path((0.9, -0.9, 0.3))
    history, _ = path((0.4, -0.2, 0.9, 0.1, 0.5, -0.9, 0.3))
    told = [lagging(load, FULL, SHARE)[0, -1] for load in (direct, history)]
    np.testing.assert_allclose(*told, rtol=1e-12)
    minor, (first, _, last) = path((0.6, 0.1, 0.6))  # a minor loop closes where it began
    inner = lagging(minor, FULL, SHARE)[0]
    np.testing.assert_allclose(inner[first], inner[last], rtol=1e-12)


def test_the_full_range_loop_has_the_stated_width():
    load, (top, bottom, end) = path((1.0, -1.0, 1.0))
    told = lagging(load, FULL, SHARE)[0]
    for sign, zero in ((1, (top + bottom) // 2), (-1, (bottom + end) // 2)):  # on the way down and up
        np.testing.assert_allclose(load[0, zero], 0, atol=1e-9)
        np.testing.assert_allclose(told[zero], sign * SHARE * FULL, rtol=1e-9)
    walk = np.random.default_rng(0).uniform(-1, 1, (3, 200, 2)) * FULL
    assert (np.abs(lagging(walk, FULL, SHARE) - walk) <= SHARE * FULL * (1 + 1e-12)).all()
    np.testing.assert_array_equal(lagging(walk, FULL, 0.0), walk)
