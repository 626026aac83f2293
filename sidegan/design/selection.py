"""Select an excitation set from a pool: by the paper's score, or by optimal experimental design.

All methods are deterministic; the first of equal candidates wins.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sidegan.base.arrays import Array, split
from sidegan.base.typed import Count, Positive
from sidegan.design.excitation import condition_of, information_of
from sidegan.errors import ConfigError, ShapeError
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory

_ROWS = 4000  # rows per batch, whose differences stay in the cache
_TIE = 1e-9  # criteria (logarithms) that differ by less are equal
_AT_ONCE = 1024  # candidates per batch: 15 MB at 43 parameters
_PRIOR = 1e-3  # prior information, as a share of an average trajectory's
_HELD = 20_000  # most trajectories whose information is kept in memory: 300 MB at 43 parameters


@dataclass(frozen=True, kw_only=True)
class Selection:
    """Number of trajectories to select from a pool, and the method."""

    count: Count = 35
    # by the paper's score, the determinant of the information, or the sum of the parameters' variances
    method: Literal["greedy", "d_optimal", "a_optimal"] = "greedy"
    noise: list[Positive] | None = None  # on each joint's torque [N·m or N], as deviations; not for greedy

    def __post_init__(self) -> None:
        if self.method == "greedy" and self.noise is not None:
            raise ConfigError("the paper's greedy score ignores noise: choose another method")


def choose(settings: Selection, body: RigidBody, trajectory: Trajectory, c: Array, diagonal: Array) -> Array:
    """Indices, (count,), of trajectories selected from a pool, (N, J, H, 2), in the order of choice.

    The paper's score only uses the diagonal of each YᵀY / T over the base columns, (N, p).
    """
    if settings.method == "greedy":
        return greedy(diagonal, settings.count)

    def information(part: Array) -> Array:
        return information_of(body, trajectory, part, noise=settings.noise)

    pick = a_optimal if settings.method == "a_optimal" else d_optimal
    pool = information(c) if len(c) <= _HELD else Candidates(len(c), lambda index: information(c[index]))
    return pick(pool, settings.count)


@dataclass(frozen=True)
class Candidates:
    """Candidates whose information is computed on access: 15 kB each at 43 parameters."""

    count: int
    information: Callable[[Array], Array]  # indices (K,) → information, (K, q, q)

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, indices: Array) -> Array:
        return self.information(indices)

    def mean(self, axis: Literal[0]) -> Array:
        """Mean information, (q, q)."""
        parts = split(np.arange(self.count), _AT_ONCE)
        return sum((self[part].sum(axis) for part in parts), np.zeros(())) / self.count


def greedy(diagonals: Array, count: int) -> Array:
    """Indices of the chosen trajectories, (count,), in the order of choice.

    With ψ_i the diagonal of YᵀY over the base columns of trajectory i, a row of (N, p), the next choice
    maximises d_i = g_i / max g + f_i / max f over those not chosen yet, where g_i = ‖ψ_i − ψ_previous‖
    (ψ_previous = 0 at first) and f_i = Σ ψ_i. A term whose maximum is zero (all others equal the previous
    choice, or nothing is excited) is zero.

    Raises:
        ShapeError: when the diagonals are not finite, non-negative (N, p), or ``count`` is not in 1 … N.

    Source: the SIDE-GAN paper, Exp 1, equations for g, f and d.
    """
    if diagonals.ndim != 2 or diagonals.shape[1] == 0:
        raise ShapeError(f"diagonals are {diagonals.shape}, expected (N, p)")
    bad = ~(np.isfinite(diagonals) & (diagonals >= 0)).all(1)
    if bad.any():
        raise ShapeError(f"diagonal[{bad.argmax()}] is not finite and non-negative")
    _check_count(count, len(diagonals))
    excitation = diagonals.sum(1)
    chosen = np.zeros(len(diagonals), dtype=bool)
    previous = np.zeros_like(diagonals[0])
    order = list[int]()
    for _ in range(count):
        # Differences, since inner products lose near neighbours to cancellation.
        differences = (part - previous for part in split(diagonals, _ROWS))
        distance = np.sqrt(np.concatenate([np.linalg.vecdot(x, x) for x in differences]))
        score = _share(distance, chosen) + _share(excitation, chosen)
        best = int(np.where(chosen, -1.0, score).argmax())
        chosen[best] = True
        previous = diagonals[best]
        order.append(best)
    return np.array(order)


def _share(x: Array, chosen: Array) -> Array:
    """Values relative to the largest not chosen yet, (N,); zeros if that is zero."""
    largest = x.max(where=~chosen, initial=0.0)
    return x / largest if largest > 0 else np.zeros_like(x)


def d_optimal(information: Array | Candidates, count: int) -> Array:
    """Greedy selection from N matrices, (N, q, q), by log det(prior + Σ): indices in order, (count,).

    The prior is a thousandth of an average trajectory. The gain over it is monotone and submodular: the
    selection has at least 1 − 1/e of the largest gain of any set of ``count``, and a candidate's earlier gain
    bounds its present one, so that most need not be evaluated again. The result does not depend on units or
    linear combinations of parameters.

    Raises:
        ShapeError: when the information is not finite or singular, or has fewer than ``count`` matrices.

    Source: Nemhauser, Wolsey, Fisher 1978 (guarantee); Minoux 1978 (bounds).
    """
    return _optimal(information, count, _log_det, bounded=True)


def a_optimal(information: Array | Candidates, count: int) -> Array:
    """Greedy selection from N matrices, (N, q, q), by tr (prior + Σ)⁻¹: indices in order, (count,).

    It minimises the sum of the parameters' variances, in their own units. The gain is not submodular: there
    is no guarantee like D-optimal's, and every choice evaluates every candidate.

    Raises:
        ShapeError: as ``d_optimal``.
    """
    return _optimal(information, count, _log_precision, bounded=False)


def _optimal(
    information: Array | Candidates, count: int, criterion: Callable[[Array], Array], bounded: bool
) -> Array:
    """Indices of the greedy selection; ``bounded``: a candidate's gain never grows."""
    if isinstance(information, np.ndarray) and (information.ndim != 3 or not len(information)):
        raise ShapeError(f"information is {information.shape}, expected (N, q, q), N ≥ 1")
    total = _PRIOR * information.mean(0)
    order = list[int]()
    if not math.isfinite(condition_of(total)):
        raise ShapeError("no trajectory excites some combination of parameters: its variance is infinite")
    _check_count(count, len(information))
    most = np.full(len(information), np.inf)  # bound on each candidate's gain
    for _ in range(count):
        added = np.full_like(most, -np.inf)
        best = 0.0
        before = criterion(total[None])
        for batch in split(np.argsort(-most, stable=True), _AT_ONCE):
            batch = batch[most[batch] >= best - 2 * _TIE]
            if not len(batch):
                break
            added[batch] = criterion(total + information[batch]) - before
            best = max(best, float(added[batch].max()))
        chosen = int((added >= added.max() - _TIE).argmax())
        order.append(chosen)
        total = total + information[np.array([chosen])][0]
        if bounded:
            most = np.where(added > -np.inf, added, most)
        most[chosen] = -np.inf
    return np.array(order)


def _check_count(count: int, available: int) -> None:
    if not 1 <= count <= available:
        raise ShapeError(f"cannot choose {count} of {available} trajectories")


def _log_det(matrices: Array) -> Array:
    """Log determinants, (K,), of positive definite matrices, (K, q, q)."""
    return 2 * np.log(np.linalg.diagonal(np.linalg.cholesky(matrices))).sum(1)


def _log_precision(matrices: Array) -> Array:
    """Negative logarithm of the trace of the inverse, (K,), of positive definite matrices, (K, q, q)."""
    from scipy.linalg import lapack  # takes a fifth of a second to import

    traces = np.empty(len(matrices))
    for k, x in enumerate(matrices):  # one triangle of the inverse is half the work
        factor, failed = lapack.dpotrf(x)
        if failed:
            raise np.linalg.LinAlgError("matrices are not positive definite")
        traces[k] = lapack.dpotri(factor)[0].trace()
    return -np.log(traces)
