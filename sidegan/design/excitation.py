"""Excitation of trajectories: spectrum and diagonal of YᵀY."""

from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array
from sidegan.motion.dynamics import RigidBody, gram
from sidegan.motion.trajectory import Trajectory


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
    """Excitation from Gram matrices of the base regressor, (B, p, p)."""
    c = body.base.subspace
    return Excitation(np.linalg.eigvalsh(c.T @ grams @ c), np.linalg.diagonal(grams))


def excite(body: RigidBody, trajectory: Trajectory, c: Array, samples: int = 80) -> Excitation:
    """Excitation of trajectories with coefficients [rad/s], (B, J, H, 2)."""
    trajectory.check(c)
    return excitation_of(body, gram(body, trajectory, c, samples))
