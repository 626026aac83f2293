"""Condition and root of information matrices."""

import math

import torch
from torch import Tensor

from sidegan.errors import ShapeError


def condition_of(information: Tensor) -> float:
    """Condition number of one information matrix, (q, q), finite; infinite where it is singular."""
    if information.ndim != 2 or information.shape[0] != information.shape[1] or not information.numel():
        raise ShapeError(f"information is {tuple(information.shape)}, expected (q, q)")
    if not information.isfinite().all():
        raise ShapeError("information is not finite")
    eigenvalues = torch.linalg.eigvalsh(information.double())
    low, high = float(eigenvalues[0]), float(eigenvalues[-1])
    singular = low <= len(eigenvalues) * torch.finfo(torch.float64).eps * high
    return math.inf if singular else high / low


def root_of(target: Tensor) -> Tensor:
    """F with F Fᵀ = target, (q, r), of a symmetric positive semidefinite target (q, q)."""
    eigenvalues, vectors = torch.linalg.eigh(target.double())
    kept = eigenvalues > 0
    return vectors[:, kept] * eigenvalues[kept].sqrt()
