"""Optimal experimental design: the trajectories whose information together is largest, picked greedily.

Before the first choice there is knowledge as from a thousandth of an average trajectory. All of it is
deterministic: criteria that differ by no more than rounding count as equal, and among equals the first index
wins.
"""

import math
from collections.abc import Callable

import torch
from torch import Tensor

from sidegan.design.criteria import condition_of
from sidegan.errors import ShapeError

_TIE = 1e-9  # criteria (logarithms) that differ by less are equal
_AT_ONCE = 1024  # candidates: 15 MB of 43 × 43
_PRIOR = 1e-3  # of an average trajectory


def d_optimal(information: Tensor, count: int) -> Tensor:
    """Indices of the greedy pick of N matrices, (N, q, q), by log det(prior + Σ), in order, (count,).

    The gain over the prior is monotone and submodular, so the pick has at least 1 − 1/e of the largest gain
    of any set of ``count``. Units and mixtures of parameters do not matter.

    Raises:
        ShapeError: when the information is not finite, leaves a direction out, or has fewer than ``count``.

    Source: Nemhauser, Wolsey, Fisher 1978 (guarantee).
    """
    return _greedy(information, count, _log_det)


def a_optimal(information: Tensor, count: int) -> Tensor:
    """Indices of the greedy pick of N matrices, (N, q, q), by tr (prior + Σ)⁻¹, in order, (count,).

    The sum of the parameters' variances, in their own units, is made small step by step. That is not
    submodular: there is no guarantee like D-optimal's.

    Raises:
        ShapeError: as ``d_optimal``.
    """
    return _greedy(information, count, _log_precision)


def _greedy(information: Tensor, count: int, criterion: Callable[[Tensor], Tensor]) -> Tensor:
    total, order = _prior(information), list[int]()
    if not 1 <= count <= len(information):
        raise ShapeError(f"cannot choose {count} of {len(information)} trajectories")
    for _ in range(count):
        values = torch.cat([criterion(total + some) for some in information.split(_AT_ONCE)])
        values[order] = -torch.inf
        best = int((values >= values.max() - _TIE).nonzero()[0])
        order.append(best)
        total = total + information[best]
    return torch.tensor(order)


def _prior(information: Tensor) -> Tensor:
    """Knowledge before the first choice, (q, q): in the trajectories' own units."""
    if information.ndim != 3 or not len(information):
        raise ShapeError(f"information is {tuple(information.shape)}, expected (N, q, q), N ≥ 1")
    mean = information.mean(0)
    if not math.isfinite(condition_of(mean)):
        raise ShapeError("no trajectory excites some direction of the parameters: nothing tells them apart")
    return _PRIOR * mean


def _log_det(matrices: Tensor) -> Tensor:
    """Logarithm of the determinants of positive definite matrices (K, q, q), (K,)."""
    return 2 * torch.linalg.cholesky(matrices).diagonal(dim1=1, dim2=2).log().sum(1)


def _log_precision(matrices: Tensor) -> Tensor:
    """Minus the logarithm of the traces of the inverses of positive definite matrices (K, q, q), (K,)."""
    factors = torch.linalg.cholesky(matrices)
    return -torch.cholesky_inverse(factors).diagonal(dim1=1, dim2=2).sum(1).log()
