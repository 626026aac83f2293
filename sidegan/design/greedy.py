"""The greedy pick of the most informative trajectories of a library."""

import torch
from torch import Tensor

from sidegan.errors import ShapeError


def greedy(diagonals: Tensor, count: int) -> Tensor:
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
    chosen = torch.zeros(len(diagonals), dtype=torch.bool, device=diagonals.device)
    previous, order = torch.zeros_like(diagonals[:1]), list[int]()
    for _ in range(count):
        # Not by inner products: their cancellation would decide between near neighbours.
        away = torch.cdist(diagonals, previous, compute_mode="donot_use_mm_for_euclid_dist")[:, 0]
        score = _share(away, chosen) + _share(excitation, chosen)
        best = int(score.masked_fill_(chosen, -1.0).argmax())
        chosen[best] = True
        previous = diagonals[best : best + 1]
        order.append(best)
    return torch.tensor(order, device=diagonals.device)


def _share(x: Tensor, chosen: Tensor) -> Tensor:
    """Part of the largest value that is left, (N,); zeros when that is zero."""
    largest = x.masked_fill(chosen, 0.0).amax()
    return torch.where(largest > 0, x / largest, torch.zeros_like(x))


def _check(diagonals: Tensor, count: int) -> None:
    if diagonals.ndim != 2 or diagonals.shape[1] == 0:
        raise ShapeError(f"diagonals are {tuple(diagonals.shape)}, expected (N, p)")
    bad = ~(torch.isfinite(diagonals) & (diagonals >= 0)).all(1)
    if bad.any():
        first = int(bad.nonzero()[0])
        raise ShapeError(f"the diagonal of trajectory {first} is not finite and non-negative")
    if not 1 <= count <= len(diagonals):
        raise ShapeError(f"cannot choose {count} of {len(diagonals)} trajectories")
