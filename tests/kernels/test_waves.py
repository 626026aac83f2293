"""Sine and cosine of many angles: numpy's extended precision is the oracle."""

import numpy as np
import pytest

from sidegan.kernels.waves import waves


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
