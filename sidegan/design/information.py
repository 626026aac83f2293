"""Information of trajectories about the identifiable parameters."""

from collections.abc import Sequence

import numpy as np

from sidegan.base.arrays import Array, flatten, split
from sidegan.errors import ShapeError
from sidegan.motion.dynamics import RigidBody, gram
from sidegan.motion.trajectory import Trajectory

_STATES_AT_ONCE = 4096  # of the weighted regressor: 10 MB at seven joints


def information_of(
    body: RigidBody,
    trajectory: Trajectory,
    c: Array,
    samples: int = 80,
    noise: Sequence[float] | None = None,
) -> Array:
    """Information per sample on the identifiable parameters, in their orthonormal basis, (N, q, q).

    The noise is the deviation of each joint's torque [N·m or N], J of them; ones when None.
    """
    trajectory.check(c)
    if noise is None:
        grams = gram(body, trajectory, c, samples)
    else:
        grams = weighted_gram(body, trajectory, c, samples, certainty_of(noise, body.joints))
    subspace = body.base.subspace
    return subspace.T @ grams @ subspace


def weighted_gram(body: RigidBody, trajectory: Trajectory, c: Array, samples: int, certainty: Array) -> Array:
    """Gram matrices per sample, (N, p, p), with each joint's rows times its certainty, (J,)."""
    times, grams = trajectory.grid(samples), []
    for part in split(c, max(1, _STATES_AT_ONCE // samples)):
        y = body.base_regressor(*trajectory.roll_out(part, times)[1:])
        rows = flatten((y * certainty[:, None]).transpose(0, 3, 2, 1), 2)  # (n, p, J T)
        grams.append(rows @ rows.mT / samples)
    return np.concatenate(grams)


def certainty_of(noise: Sequence[float], joints: int) -> Array:
    """One over the deviation of each joint's torque, (J,)."""
    if len(noise) != joints or not all(x > 0 for x in noise):
        raise ShapeError(f"noise is {list(noise)}, expected {joints} positive deviations")
    return 1 / np.array(noise)
