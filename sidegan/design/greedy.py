"""The greedy pick of the most informative trajectories of a library."""

from bisect import bisect_right
from collections.abc import Sequence
from itertools import accumulate

import torch
from torch import Tensor

from sidegan.errors import ShapeError


def greedy(diagonals: Tensor | Sequence[Tensor], count: int) -> Tensor:
    """Indices of the chosen trajectories in the order of choice, (count,).

    The diagonals of YᵀY over the base columns are (N, p), or parts of that, (N_k, p) each, which may be read
    from a file when needed: one is in memory at a time, and two numbers per trajectory. With ψ_i the diagonal
    of trajectory i, the next choice is the largest of d_i = g_i / max g + f_i / max f over those not chosen
    yet, where g_i = ‖ψ_i − ψ_previous‖ (ψ_previous = 0 at first) and f_i = Σ ψ_i; the first index wins a tie.
    A maximum of zero (all that is left equals the previous choice, or nothing is excited) makes its term
    zero.

    Raises:
        ShapeError: when a part is not a finite, non-negative (N_k, p), or ``count`` is not in 1 … N.

    Source: the SIDE-GAN paper, Exp 1, equations for g, f and d.
    """
    parts = [diagonals] if isinstance(diagonals, Tensor) else diagonals
    sums = _excitation(parts, count)
    starts = [0, *accumulate(len(part) for part in sums)]
    excitation = torch.cat(sums)
    chosen = torch.zeros(len(excitation), dtype=torch.bool, device=excitation.device)
    previous = parts[0].new_zeros(1, parts[0].shape[1])
    order = []
    for _ in range(count):
        # Not by inner products: their cancellation would decide between near neighbours.
        exact = "donot_use_mm_for_euclid_dist"
        reach = [torch.cdist(parts[k], previous, compute_mode=exact)[:, 0] for k in range(len(parts))]
        score = _share(torch.cat(reach), chosen) + _share(excitation, chosen)
        best = int(score.masked_fill_(chosen, -1.0).argmax())
        chosen[best] = True
        part = bisect_right(starts, best) - 1
        previous = parts[part][best - starts[part]][None]
        order.append(best)
    return torch.tensor(order, device=excitation.device)


def _share(x: Tensor, chosen: Tensor) -> Tensor:
    """Part of the largest value that is left, (N,); zeros when that is zero."""
    largest = x.masked_fill(chosen, 0.0).amax()
    return torch.where(largest > 0, x / largest, torch.zeros_like(x))


def _excitation(parts: Sequence[Tensor], count: int) -> list[Tensor]:
    """Sum of each diagonal, (N_k,) of each part, after a look at their shapes and values."""
    sums: list[Tensor] = []
    total = 0
    for k in range(len(parts)):
        part = parts[k]
        if part.ndim != 2 or part.shape[1] == 0:
            raise ShapeError(f"diagonals are {tuple(part.shape)}, expected (N, p)")
        bad = ~(torch.isfinite(part) & (part >= 0)).all(1)
        if bad.any():
            first = total + int(bad.nonzero()[0])
            raise ShapeError(f"the diagonal of trajectory {first} is not finite and non-negative")
        sums.append(part.sum(1))
        total += len(part)
    if not 1 <= count <= total:
        raise ShapeError(f"cannot choose {count} of {total} trajectories")
    return sums
