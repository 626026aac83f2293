"""Information of trajectories about the identifiable parameters."""

from collections.abc import Sequence

import torch
from torch import Tensor

from sidegan.errors import ShapeError
from sidegan.motion.dynamics import RigidBody, gram
from sidegan.motion.trajectory import Trajectory

_STATES_AT_ONCE = 4096  # of the weighted regressor: 10 MB at seven joints


def information_of(
    body: RigidBody,
    trajectory: Trajectory,
    c: Tensor,
    samples: int = 80,
    noise: Sequence[float] | None = None,
) -> Tensor:
    """Information per sample on the identifiable parameters, in their orthonormal basis, (N, q, q) float64.

    The noise is the deviation of each joint's torque [N·m or N], J of them; ones when None.
    """
    trajectory.check(c)
    if noise is None:
        grams = gram(body, trajectory, c, samples)
    else:
        grams = weighted_gram(body, trajectory, c, samples, certainty_of(noise, body.joints))
    subspace = body.base.subspace.to(grams)
    return subspace.T @ grams @ subspace


def weighted_gram(
    body: RigidBody, trajectory: Trajectory, c: Tensor, samples: int, certainty: Tensor
) -> Tensor:
    """Gram matrices per sample, (N, p, p), with each joint's rows times its certainty, (J,)."""
    times, grams = trajectory.grid(samples), []
    for part in c.split(max(1, _STATES_AT_ONCE // samples)):
        y = body.base_regressor(*trajectory.roll_out(part, times)[1:])
        rows = (y * certainty[:, None]).flatten(1, 2)
        grams.append(rows.mT @ rows / samples)
    return torch.cat(grams)


def certainty_of(noise: Sequence[float], joints: int) -> Tensor:
    """One over the deviation of each joint's torque, (J,)."""
    if len(noise) != joints or not all(x > 0 for x in noise):
        raise ShapeError(f"noise is {list(noise)}, expected {joints} positive deviations")
    return 1 / torch.tensor(noise, dtype=torch.float64)
