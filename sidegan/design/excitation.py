"""Excitation of trajectories, and their information on the identifiable parameters."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array, split
from sidegan.errors import ShapeError
from sidegan.motion.dynamics import RigidBody, gram
from sidegan.motion.trajectory import Trajectory

_LARGEST = 1e300  # element of a Gram matrix, whose sums are finite
_AT_ONCE = 1000  # trajectories per batch of Gram matrices
_SAMPLES = 80  # least time points for the information of a trajectory
_PER_HARMONIC = 4  # least time points: condition numbers are then accurate to 1 %


@dataclass(frozen=True)
class Excitation:
    """Excitation of B trajectories."""

    # eigenvalues of YᵀY / T in an orthonormal basis of the identifiable subspace, ascending, (B, p); rounding
    # can make the smallest slightly negative
    spectrum: Array
    diagonal: Array  # diagonal of YᵀY / T over the base columns, (B, p)

    @property
    def eigenvalue_fitness(self) -> Array:
        """Condition number of YᵀY, (B,); infinite if a direction is not excited."""
        low, high = self.spectrum[:, 0], self.spectrum[:, -1]
        return _ratio(high, low, self.spectrum.shape[1])

    @property
    def diagonal_fitness(self) -> Array:
        """Largest over smallest diagonal element of YᵀY over the base columns, (B,)."""
        return _ratio(self.diagonal.max(1), self.diagonal.min(1), 1)


def _ratio(high: Array, low: Array, errors: int) -> Array:
    """Ratio of high to low, infinite if low is within a number of rounding errors of high."""
    significant = low > errors * np.finfo(float).eps * high
    return np.divide(high, low, out=np.full_like(high, np.inf), where=significant)


def excitation_of(body: RigidBody, grams: Array) -> Excitation:
    """Excitation from Gram matrices of the base regressor, (B, p, p); none if one overflows."""
    c = body.base.subspace
    grams = np.where((np.abs(grams) <= _LARGEST).all((1, 2), keepdims=True), grams, 0.0)
    return Excitation(np.linalg.eigvalsh(c.T @ grams @ c), np.linalg.diagonal(grams))


def enough_samples(trajectory: Trajectory, least: int) -> int:
    """Number of time points of a period that resolves all harmonics, and at least this many."""
    return max(least, _PER_HARMONIC * trajectory.harmonics)


def measure_excitation(
    body: RigidBody, trajectory: Trajectory, c: Array, samples: int | None = None
) -> Excitation:
    """Excitation of trajectories with coefficients [rad/s], (B, J, H, 2); ``samples`` None: enough."""
    trajectory.check(c)
    if samples is None:
        samples = enough_samples(trajectory, _SAMPLES)
    return excitation_of(body, gram(body, trajectory, c, samples))


def information_of(
    body: RigidBody, trajectory: Trajectory, c: Array, noise: Sequence[float] | None = None
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
    samples = enough_samples(trajectory, _SAMPLES)
    grams = (gram(body, trajectory, part, samples, certainty) for part in split(c, _AT_ONCE))
    return np.concatenate([subspace.T @ x @ subspace for x in grams])


def condition_of(information: Array) -> float:
    """Condition number of an information matrix, (q, q); infinite if it is singular."""
    if not np.isfinite(information).all():
        raise ShapeError("information is not finite")
    eigenvalues = np.linalg.eigvalsh(information)
    return _ratio(eigenvalues[-1:], eigenvalues[:1], len(eigenvalues)).item()
