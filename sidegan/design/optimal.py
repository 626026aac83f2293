"""Optimal experimental design: the trajectories whose information together is largest, picked greedily.

Before the first choice there is knowledge as from a thousandth of an average trajectory. All of it is
deterministic: criteria that differ by no more than rounding count as equal, and among equals the first index
wins. Information of many candidates need not be held: a ``Candidates`` makes it when it is looked at.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array, split
from sidegan.design.criteria import condition_of
from sidegan.errors import ShapeError

_TIE = 1e-9  # criteria (logarithms) that differ by less are equal
_AT_ONCE = 1024  # candidates: 15 MB of 43 × 43
_PRIOR = 1e-3  # of an average trajectory


@dataclass(frozen=True)
class Candidates:
    """Candidates whose information is too large to be held: 15 kB each at 43 parameters."""

    count: int
    information: Callable[[Array], Array]  # indices (K,) → information, (K, q, q)

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, indices: Array) -> Array:
        return self.information(indices)


def d_optimal(information: Array | Candidates, count: int) -> Array:
    """Indices of the greedy pick of N matrices, (N, q, q), by log det(prior + Σ), in order, (count,).

    The gain over the prior is monotone and submodular, so the pick has at least 1 − 1/e of the largest gain
    of any set of ``count``, and what a candidate would have added before bounds what it adds now: most need
    not be looked at again. Units and mixtures of parameters do not matter.

    Raises:
        ShapeError: when the information is not finite, leaves a direction out, or has fewer than ``count``.

    Source: Nemhauser, Wolsey, Fisher 1978 (guarantee); Minoux 1978 (bounds).
    """
    return _greedy(information, count, _log_det, bounded=True)


def a_optimal(information: Array | Candidates, count: int) -> Array:
    """Indices of the greedy pick of N matrices, (N, q, q), by tr (prior + Σ)⁻¹, in order, (count,).

    The sum of the parameters' variances, in their own units, is made small step by step. That is not
    submodular: there is no guarantee like D-optimal's, and every candidate is looked at for every choice.

    Raises:
        ShapeError: as ``d_optimal``.
    """
    return _greedy(information, count, _log_precision, bounded=False)


def _greedy(
    information: Array | Candidates, count: int, criterion: Callable[[Array], Array], bounded: bool
) -> Array:
    """Indices of the greedy pick; ``bounded``: a candidate never adds more than it would have before."""
    total, order = _prior(information), list[int]()
    if not 1 <= count <= len(information):
        raise ShapeError(f"cannot choose {count} of {len(information)} trajectories")
    most = np.full(len(information), np.inf)  # that each can add
    for _ in range(count):
        added, best, before = np.full_like(most, -np.inf), 0.0, criterion(total[None])
        for some in split(np.argsort(-most, stable=True), _AT_ONCE):
            some = some[most[some] >= best - 2 * _TIE]
            if not len(some):
                break
            added[some] = criterion(total + information[some]) - before
            best = max(best, float(added[some].max()))
        chosen = int((added >= added.max() - _TIE).argmax())  # the first of them
        order.append(chosen)
        total = total + information[np.array([chosen])][0]
        if bounded:
            most = np.where(added > -np.inf, added, most)
        most[chosen] = -np.inf
    return np.array(order)


def _prior(information: Array | Candidates) -> Array:
    """Knowledge before the first choice, (q, q): in the trajectories' own units."""
    if isinstance(information, Candidates):
        parts = split(np.arange(len(information)), _AT_ONCE)
        mean = np.stack([information[some].sum(0) for some in parts]).sum(0) / len(information)
    elif information.ndim != 3 or not len(information):
        raise ShapeError(f"information is {information.shape}, expected (N, q, q), N ≥ 1")
    else:
        mean = information.mean(0)
    if not math.isfinite(condition_of(mean)):
        raise ShapeError("no trajectory excites some direction of the parameters: they cannot be told apart")
    return _PRIOR * mean


def _log_det(matrices: Array) -> Array:
    """Logarithm of the determinants of positive definite matrices (K, q, q), (K,)."""
    return 2 * np.log(np.linalg.diagonal(np.linalg.cholesky(matrices))).sum(1)


def _log_precision(matrices: Array) -> Array:
    """Minus the logarithm of the traces of the inverses of positive definite matrices (K, q, q), (K,)."""
    from scipy.linalg import lapack  # takes a fifth of a second to import

    traces = np.empty(len(matrices))
    for k, x in enumerate(matrices):  # one triangle of the inverse is half the work
        factor, failed = lapack.dpotrf(x)
        if failed:
            raise np.linalg.LinAlgError("matrices are not positive definite")
        traces[k] = lapack.dpotri(factor)[0].trace()
    return -np.log(traces)
