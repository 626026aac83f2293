"""Builders of the room: random chains and their states."""

import torch

from sidegan.motion.dynamics import RigidBody
from sidegan.validity import Box, Convex, Plane, Sphere
from tests.chains import random_chain, random_states

CHAINS = [(joints, seed) for joints in range(1, 10) for seed in range(3)]
REGIONS = {
    "plane": Plane((0.2, -0.3, 0.9), 0.4),
    "box": Box((-0.4, -0.3, 0.2), (0.3, 0.4, 0.9)),
    "ball": Sphere((0.2, 0.1, 0.5), 0.3),
    "body": Convex.between((-0.3, -0.2, 0.3), (0.2, 0.3, 0.8), 0.2),
}


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
    pairs = (
        [(found, expected)] if isinstance(found, torch.Tensor) else list(zip(found, expected, strict=True))
    )
    scale = max((float(other.detach().abs().max()) for _, other in pairs if other.numel()), default=0.0)
    for one, other in pairs:
        torch.testing.assert_close(one, other, rtol=0, atol=precision * scale)
