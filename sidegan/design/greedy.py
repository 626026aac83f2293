"""The greedy pick of the most informative trajectories of a library."""

import numpy as np

from sidegan.base.arrays import Array, split
from sidegan.errors import ShapeError

_ROWS = 4000  # whose differences stay near the processor


def greedy(diagonals: Array, count: int) -> Array:
    """Indices of the chosen trajectories in the order of choice, (count,).

    With ψ_i the diagonal of YᵀY over the base columns of trajectory i, a row of (N, p), the next choice is
    the largest of d_i = g_i / max g + f_i / max f over those not chosen yet, where g_i = ‖ψ_i − ψ_previous‖
    (ψ_previous = 0 at first) and f_i = Σ ψ_i; the first index wins a tie. A maximum of zero (all that is left
    equals the previous choice, or nothing is excited) makes its term zero.

    Raises:
        ShapeError: when the diagonals are not finite, non-negative (N, p), or ``count`` is not in 1 … N.

    Source: the SIDE-GAN paper, Exp 1, equations for g, f and d.
    """
    _check(diagonals, count)
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


def _check(diagonals: Array, count: int) -> None:
    if diagonals.ndim != 2 or diagonals.shape[1] == 0:
        raise ShapeError(f"diagonals are {diagonals.shape}, expected (N, p)")
    bad = ~(np.isfinite(diagonals) & (diagonals >= 0)).all(1)
    if bad.any():
        raise ShapeError(f"the diagonal of trajectory {bad.argmax()} is not finite and non-negative")
    if not 1 <= count <= len(diagonals):
        raise ShapeError(f"cannot choose {count} of {len(diagonals)} trajectories")
