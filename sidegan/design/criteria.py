"""Condition and root of information matrices."""

import math

import numpy as np

from sidegan.base.arrays import Array
from sidegan.errors import ShapeError


def condition_of(information: Array) -> float:
    """Condition number of one information matrix, (q, q), finite; infinite where it is singular."""
    if information.ndim != 2 or information.shape[0] != information.shape[1] or not information.size:
        raise ShapeError(f"information is {information.shape}, expected (q, q)")
    if not np.isfinite(information).all():
        raise ShapeError("information is not finite")
    eigenvalues = np.linalg.eigvalsh(information)
    low, high = float(eigenvalues[0]), float(eigenvalues[-1])
    singular = low <= len(eigenvalues) * np.finfo(float).eps * high
    return math.inf if singular else high / low


def root_of(target: Array) -> Array:
    """F with F Fᵀ = target, (q, r), of a symmetric positive semidefinite target (q, q)."""
    eigenvalues, vectors = np.linalg.eigh(target)
    kept = eigenvalues > 0
    return vectors[:, kept] * np.sqrt(eigenvalues[kept])
