"""Information of trajectories about the identifiable parameters."""

import torch
from torch import Tensor

from sidegan.errors import ShapeError
from sidegan.motion.dynamics import RigidBody, gram
from sidegan.motion.trajectory import Motion, Trajectory

_STATES_AT_ONCE = 4096  # of the weighted regressor: 10 MB at seven joints


def information_of(
    body: RigidBody,
    trajectory: Trajectory,
    c: Tensor,
    samples: int = 80,
    deviation: Tensor | None = None,
) -> Tensor:
    """Information per sample on the identifiable parameters, in their orthonormal basis, (N, q, q) float64.

    The deviation of torque noise [N·m or N] is that of each joint, (J,), or (N, J) where it differs between
    trajectories; ones when None.
    """
    trajectory.check(c)
    if deviation is None:
        grams = gram(body, trajectory, c, samples)
    else:
        weights = 1 / _deviations(deviation, len(c), body.joints).to(c)
        times, few = trajectory.grid(samples), max(1, _STATES_AT_ONCE // samples)
        parts = zip(c.split(few), weights[:, None].split(few))
        grams = torch.cat([weighted_gram(body, trajectory.roll_out(part, times), w) for part, w in parts])
    subspace = body.base.subspace.to(grams)
    return subspace.T @ grams @ subspace


def weighted_gram(body: RigidBody, motion: Motion, weights: Tensor) -> Tensor:
    """Gram matrices per sample with each joint's rows times its weight, (J,) or (B, 1, J), (B, p, p)."""
    rows = (body.base_regressor(*motion[1:]) * weights[..., None]).flatten(1, 2)
    return rows.mT @ rows / len(motion.time)


def _deviations(deviation: Tensor, count: int, joints: int) -> Tensor:
    """One for each trajectory and joint, (N, J)."""
    if deviation.shape not in ((joints,), (count, joints)):
        raise ShapeError(
            f"deviations are {tuple(deviation.shape)}, expected ({joints},) or ({count}, {joints})"
        )
    if not (deviation.isfinite() & (deviation > 0)).all():
        raise ShapeError("deviations of torque noise must be finite and positive")
    return deviation.expand(count, joints)
