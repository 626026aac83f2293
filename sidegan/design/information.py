"""Information of trajectories on the identifiable parameters."""

import math
from collections.abc import Sequence

import numpy as np

from sidegan.base.arrays import Array, split
from sidegan.errors import ShapeError
from sidegan.motion.dynamics import RigidBody, gram
from sidegan.motion.trajectory import Trajectory

_AT_ONCE = 1000  # trajectories per batch of Gram matrices


def information_of(
    body: RigidBody,
    trajectory: Trajectory,
    c: Array,
    samples: int = 80,
    noise: Sequence[float] | None = None,
) -> Array:
    """Information per sample on the identifiable parameters, in their orthonormal basis, (N, q, q).

    ``noise`` is the standard deviation of each joint's torque [N·m or N], J values; ones when None.
    """
    trajectory.check(c)
    certainty = None
    if noise is not None:
        if len(noise) != body.joints or not all(x > 0 for x in noise):
            raise ShapeError(f"noise is {list(noise)}, expected {body.joints} positive deviations")
        certainty = 1 / np.array(noise)
    subspace = body.base.subspace
    grams = (gram(body, trajectory, part, samples, certainty) for part in split(c, _AT_ONCE))
    return np.concatenate([subspace.T @ x @ subspace for x in grams])


def condition_of(information: Array) -> float:
    """Condition number of an information matrix, (q, q); infinite if it is singular."""
    if not np.isfinite(information).all():
        raise ShapeError("information is not finite")
    eigenvalues = np.linalg.eigvalsh(information)
    low, high = float(eigenvalues[0]), float(eigenvalues[-1])
    singular = low <= len(eigenvalues) * np.finfo(float).eps * high
    return math.inf if singular else high / low
