"""The pick of an excitation set from a pool: the paper's score, or optimal experimental design.

All of it is deterministic, and the first of equals wins.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sidegan.base.arrays import Array, split
from sidegan.base.typed import Count, Positive
from sidegan.design.information import condition_of, information_of
from sidegan.errors import ConfigError, ShapeError
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory

_ROWS = 4000  # whose differences stay near the processor
_TIE = 1e-9  # criteria (logarithms) that differ by less are equal
_AT_ONCE = 1024  # candidates: 15 MB of 43 × 43
_PRIOR = 1e-3  # of an average trajectory, that is known before the first choice
_HELD = 20_000  # trajectories whose information is held: 300 MB at 43 parameters


@dataclass(frozen=True, kw_only=True)
class Selection:
    """How many trajectories are picked from a pool, and by what."""

    count: Count = 35
    method: Literal["greedy", "d_optimal", "a_optimal"] = "greedy"
    # of each joint's torque [N·m], by which the joints count; not for greedy
    noise: list[Positive] | None = None

    def __post_init__(self) -> None:
        if self.method == "greedy" and self.noise is not None:
            raise ConfigError("the paper's greedy score ignores noise: choose another method")


def choose(settings: Selection, body: RigidBody, trajectory: Trajectory, c: Array, diagonal: Array) -> Array:
    """Indices of the trajectories picked from a pool (N, J, H, 2), in the order of choice, (count,).

    The paper's score looks at the diagonal of each YᵀY / T over the base columns alone, (N, p).
    """
    if settings.method == "greedy":
        return greedy(diagonal, settings.count)

    def information(some: Array) -> Array:
        return information_of(body, trajectory, some, noise=settings.noise)

    pick = a_optimal if settings.method == "a_optimal" else d_optimal
    pool = information(c) if len(c) <= _HELD else Candidates(len(c), lambda index: information(c[index]))
    return pick(pool, settings.count)


@dataclass(frozen=True)
class Candidates:
    """Candidates whose information is made when it is looked at: 15 kB each at 43 parameters."""

    count: int
    information: Callable[[Array], Array]  # indices (K,) → information, (K, q, q)

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, indices: Array) -> Array:
        return self.information(indices)

    def mean(self, axis: Literal[0]) -> Array:
        """Mean information, (q, q)."""
        parts = split(np.arange(self.count), _AT_ONCE)
        return sum((self[some].sum(axis) for some in parts), np.zeros(())) / self.count


def greedy(diagonals: Array, count: int) -> Array:
    """Indices of the chosen trajectories in the order of choice, (count,).

    With ψ_i the diagonal of YᵀY over the base columns of trajectory i, a row of (N, p), the next choice is
    the largest of d_i = g_i / max g + f_i / max f over those not chosen yet, where g_i = ‖ψ_i − ψ_previous‖
    (ψ_previous = 0 at first) and f_i = Σ ψ_i. A maximum of zero (all that is left equals the previous choice,
    or nothing is excited) makes its term zero.

    Raises:
        ShapeError: when the diagonals are not finite, non-negative (N, p), or ``count`` is not in 1 … N.

    Source: the SIDE-GAN paper, Exp 1, equations for g, f and d.
    """
    if diagonals.ndim != 2 or diagonals.shape[1] == 0:
        raise ShapeError(f"diagonals are {diagonals.shape}, expected (N, p)")
    bad = ~(np.isfinite(diagonals) & (diagonals >= 0)).all(1)
    if bad.any():
        raise ShapeError(f"the diagonal of trajectory {bad.argmax()} is not finite and non-negative")
    _check_count(count, len(diagonals))
    excitation = diagonals.sum(1)
    chosen = np.zeros(len(diagonals), dtype=bool)
    previous, order = np.zeros_like(diagonals[0]), list[int]()
    for _ in range(count):
        # Not by inner products: their cancellation would decide between near neighbours.
        apart = (part - previous for part in split(diagonals, _ROWS))
        away = np.sqrt(np.concatenate([np.linalg.vecdot(x, x) for x in apart]))
        score = _share(away, chosen) + _share(excitation, chosen)
        best = int(np.where(chosen, -1.0, score).argmax())
        chosen[best] = True
        previous = diagonals[best]
        order.append(best)
    return np.array(order)


def _share(x: Array, chosen: Array) -> Array:
    """Part of the largest value that is left, (N,); zeros when that is zero."""
    largest = x.max(where=~chosen, initial=0.0)
    return x / largest if largest > 0 else np.zeros_like(x)


def d_optimal(information: Array | Candidates, count: int) -> Array:
    """Indices of the greedy pick of N matrices, (N, q, q), by log det(prior + Σ), in order, (count,).

    The prior is a thousandth of an average trajectory. The gain over it is monotone and submodular, so the
    pick has at least 1 − 1/e of the largest gain of any set of ``count``, and what a candidate would have
    added before bounds what it adds now: most need not be looked at again. Units and mixtures of parameters
    do not matter.

    Raises:
        ShapeError: when the information is not finite, leaves a direction out, or has fewer than ``count``.

    Source: Nemhauser, Wolsey, Fisher 1978 (guarantee); Minoux 1978 (bounds).
    """
    return _optimal(information, count, _log_det, bounded=True)


def a_optimal(information: Array | Candidates, count: int) -> Array:
    """Indices of the greedy pick of N matrices, (N, q, q), by tr (prior + Σ)⁻¹, in order, (count,).

    The sum of the parameters' variances, in their own units, is made small step by step. That is not
    submodular: there is no guarantee like D-optimal's, and every candidate is looked at for every choice.

    Raises:
        ShapeError: as ``d_optimal``.
    """
    return _optimal(information, count, _log_precision, bounded=False)


def _optimal(
    information: Array | Candidates, count: int, criterion: Callable[[Array], Array], bounded: bool
) -> Array:
    """Indices of the greedy pick; ``bounded``: a candidate never adds more than it would have before."""
    if isinstance(information, np.ndarray) and (information.ndim != 3 or not len(information)):
        raise ShapeError(f"information is {information.shape}, expected (N, q, q), N ≥ 1")
    total, order = _PRIOR * information.mean(0), list[int]()
    if not math.isfinite(condition_of(total)):
        raise ShapeError("no trajectory excites some combination of parameters: they cannot be told apart")
    _check_count(count, len(information))
    most = np.full(len(information), np.inf)  # that each can add
    for _ in range(count):
        added, best, before = np.full_like(most, -np.inf), 0.0, criterion(total[None])
        for some in split(np.argsort(-most, stable=True), _AT_ONCE):
            some = some[most[some] >= best - 2 * _TIE]
            if not len(some):
                break
            added[some] = criterion(total + information[some]) - before
            best = max(best, float(added[some].max()))
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
