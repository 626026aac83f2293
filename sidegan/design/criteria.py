"""Criteria of information matrices: how much a set tells, and what an optimal design makes large."""

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import torch
from torch import Tensor

from sidegan.errors import ShapeError

_TINY = torch.finfo(torch.float64).tiny
_ROUNDING = 16  # times q ε: what a matrix may lack to be symmetric and semidefinite

Bound = Callable[[Tensor], Tensor]


class Criteria(NamedTuple):
    """How much a set tells."""

    log_det: float  # logarithm of the determinant of the information; D-optimal sets maximise it
    trace_inverse: float  # of its inverse, the sum of the variances; A-optimal sets minimise it
    covariance_norm: float  # ‖diag P‖₂ of its inverse P
    condition: float  # condition number


def criteria_of(information: Tensor) -> Criteria:
    """Criteria of one information matrix, (q, q), finite; where it is singular −∞ and three times ∞."""
    if information.ndim != 2 or information.shape[0] != information.shape[1] or not information.numel():
        raise ShapeError(f"information is {tuple(information.shape)}, expected (q, q)")
    if not information.isfinite().all():
        raise ShapeError("information is not finite")
    eigenvalues, vectors = torch.linalg.eigh(information.double())
    low, high = float(eigenvalues[0]), float(eigenvalues[-1])
    if low <= len(eigenvalues) * torch.finfo(torch.float64).eps * high:
        return Criteria(-math.inf, math.inf, math.inf, math.inf)
    return Criteria(
        log_det=float(eigenvalues.log().sum()),
        trace_inverse=float((1 / eigenvalues).sum()),
        covariance_norm=float(torch.linalg.vector_norm((vectors.square() / eigenvalues).sum(1))),
        condition=high / low,
    )


class Criterion(NamedTuple):
    """A measure of information matrices that is to be made large."""

    # of positive definite matrices (K, q, q), (K,), a logarithm; −∞ where one is not
    value: Callable[[Tensor], Tensor]
    # of a reference (q, q): a weight W (q, q) and an increasing function g with value(M) ≤ g(tr W M) for
    # every M, equal where M is a multiple of the reference
    tangent: Callable[[Tensor], tuple[Tensor, Bound]]


def inverse(matrix: Tensor) -> Tensor:
    """Inverse of a positive definite matrix, (q, q)."""
    return torch.cholesky_inverse(torch.linalg.cholesky(matrix))


def _log_det(matrices: Tensor) -> Tensor:
    """Logarithm of det M, (K,)."""
    factor, failed = torch.linalg.cholesky_ex(matrices)
    value = 2 * factor.diagonal(dim1=1, dim2=2).clamp_min(_TINY).log().sum(1)
    return torch.where(failed == 0, value, -torch.inf)


def _log_det_tangent(reference: Tensor) -> tuple[Tensor, Bound]:
    """With X = reference⁻¹: log det M ≤ q log(tr(X M) / q) − log det X, as means exceed geometric means."""
    size, height = len(reference), float(_log_det(reference[None]))
    return inverse(reference), lambda t: height + size * (t.clamp_min(_TINY) / size).log()


def variance(target: Tensor | None = None) -> Criterion:
    """The criterion −log tr(target · M⁻¹): the sum of the variances of what the target stands for.

    With the identity (None) it is A-optimality: the variances of the parameters in their own units. With the
    mean information of motions to come it is the variance of the torques that are predicted for them.

    Raises:
        ShapeError: when the target is not symmetric and positive semidefinite, (q, q), or is zero; by the
            criterion's functions, when it does not fit a matrix.
    """
    rows = None if target is None else root_of(target)
    return Criterion(partial(_log_precision, rows), partial(_log_precision_tangent, rows))


def root_of(target: Tensor) -> Tensor:
    """F with F Fᵀ = target, (q, r)."""
    if target.ndim != 2 or target.shape[0] != target.shape[1] or not target.isfinite().all():
        raise ShapeError(f"target is {tuple(target.shape)}, expected finite numbers (q, q)")
    eigenvalues, vectors = torch.linalg.eigh(target.double())
    noise = _ROUNDING * len(target) * torch.finfo(target.dtype).eps * float(target.abs().max())
    if float((target - target.T).abs().max()) > noise or eigenvalues[0] < -noise or eigenvalues[-1] <= 0:
        raise ShapeError("target is not symmetric and positive semidefinite, or zero")
    kept = eigenvalues > 0
    return vectors[:, kept] * eigenvalues[kept].sqrt()


def _columns(rows: Tensor | None, like: Tensor) -> Tensor:
    if rows is None:
        return torch.eye(like.shape[-1]).to(like)
    if len(rows) != like.shape[-1]:
        raise ShapeError(f"target of {len(rows)} parameters for information on {like.shape[-1]}")
    return rows.to(like)


def _log_precision(rows: Tensor | None, matrices: Tensor) -> Tensor:
    """Minus the logarithm of tr(Fᵀ M⁻¹ F), (K,)."""
    factor, failed = torch.linalg.cholesky_ex(matrices)
    columns = _columns(rows, matrices)
    factor = torch.where((failed == 0)[:, None, None], factor, torch.eye(matrices.shape[1]).to(factor))
    half = torch.linalg.solve_triangular(factor, columns.expand(len(factor), -1, -1), upper=False)
    return torch.where(failed == 0, -half.square().sum((1, 2)).log(), -torch.inf)


def _log_precision_tangent(rows: Tensor | None, reference: Tensor) -> tuple[Tensor, Bound]:
    """With X = reference⁻¹: tr(Fᵀ M⁻¹ F) ≥ (tr Fᵀ X F)² / tr(X F Fᵀ X M), the Cauchy-Schwarz inequality."""
    columns = _columns(rows, reference)
    carried = inverse(reference) @ columns
    height = -2 * math.log(float((columns * carried).sum()))
    return carried @ carried.T, lambda t: height + t.clamp_min(_TINY).log()


DETERMINANT = Criterion(_log_det, _log_det_tangent)
