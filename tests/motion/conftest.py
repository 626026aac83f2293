"""Builders of the room: random chains and their states."""

import torch

from sidegan.motion.dynamics import RigidBody
from tests.chains import random_chain, random_states

CHAINS = [(joints, seed) for joints in range(1, 10) for seed in range(3)]


def normal(*shape, seed=1):
    """Normal numbers in double precision."""
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def body_and_states(chain, *shape):
    """A random chain and states of it, three tensors of (*shape, J)."""
    arm, _ = random_chain(*chain)
    count = int(torch.tensor(shape).prod())
    return RigidBody(arm), [x.reshape(*shape, arm.joints) for x in random_states(arm, count, chain[1])]


def close(found, expected, precision):
    """Assert that tensors are the same up to a share of their largest element."""
    scale = float(expected.detach().abs().max()) if expected.numel() else 0.0
    torch.testing.assert_close(found, expected, rtol=0, atol=precision * scale)
