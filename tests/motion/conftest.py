"""Builders of the room: random chains and their states."""

import math

import numpy as np

from sidegan.motion.dynamics import RigidBody
from tests.chains import random_chain, random_states

CHAINS = [(joints, seed) for joints in range(1, 10) for seed in range(3)]


def normal(*shape, seed=1):
    """Normal numbers in double precision."""
    return np.random.default_rng(seed).standard_normal(shape)


def body_and_states(chain, *shape):
    """A random chain and states of it, three arrays of (*shape, J)."""
    arm, _ = random_chain(*chain)
    count = math.prod(shape)
    return RigidBody(arm), [x.reshape(*shape, arm.joints) for x in random_states(arm, count, chain[1])]


def close(found, expected, precision):
    """Assert that arrays are the same up to a share of their largest element."""
    scale = float(np.abs(expected).max()) if expected.size else 0.0
    np.testing.assert_allclose(found, expected, rtol=0, atol=precision * scale)
