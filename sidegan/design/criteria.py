"""Criteria of information matrices: how much a set tells."""

import math
from typing import NamedTuple

import torch
from torch import Tensor

from sidegan.errors import ShapeError


class Criteria(NamedTuple):
    """How much a set tells."""

    log_det: float  # logarithm of the determinant of the information
    condition: float  # condition number


def criteria_of(information: Tensor) -> Criteria:
    """Criteria of one information matrix, (q, q), finite; where it is singular −∞ and ∞."""
    if information.ndim != 2 or information.shape[0] != information.shape[1] or not information.numel():
        raise ShapeError(f"information is {tuple(information.shape)}, expected (q, q)")
    if not information.isfinite().all():
        raise ShapeError("information is not finite")
    eigenvalues = torch.linalg.eigvalsh(information.double())
    low, high = float(eigenvalues[0]), float(eigenvalues[-1])
    if low <= len(eigenvalues) * torch.finfo(torch.float64).eps * high:
        return Criteria(-math.inf, math.inf)
    return Criteria(float(eigenvalues.log().sum()), high / low)


def root_of(target: Tensor) -> Tensor:
    """F with F Fᵀ = target, (q, r), of a symmetric positive semidefinite target (q, q)."""
    eigenvalues, vectors = torch.linalg.eigh(target.double())
    kept = eigenvalues > 0
    return vectors[:, kept] * eigenvalues[kept].sqrt()
