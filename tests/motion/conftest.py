"""Numbers and comparisons of the room."""

import numpy as np

CHAINS = [(joints, seed) for joints in range(1, 10) for seed in range(3)]


def normal(*shape, seed=1):
    """Normal numbers in double precision."""
    return np.random.default_rng(seed).standard_normal(shape)


def close(found, expected, precision):
    """Assert that arrays are the same up to a share of their largest element."""
    scale = float(np.abs(expected).max()) if expected.size else 0.0
    np.testing.assert_allclose(found, expected, rtol=0, atol=precision * scale)
