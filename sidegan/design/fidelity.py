"""How one set of trajectories is like another: what offsets, copies and other sizes do not fool.

A set is rows of any shape, (N, …): coefficients [rad/s], or the logarithm of diag(YᵀY).
"""

import torch
from torch import Tensor

from sidegan.design.excitation import effective_rank
from sidegan.errors import ShapeError

_NEIGHBOURS = 5  # k of density and coverage, as their authors have it
_FOLDS = 10  # of the classifier's cross-validation
_RIDGE = 0.1  # of its least squares


def proportions(x: Tensor) -> dict[str, float]:
    """Size, cosine and uncentred rank of a set: what it has in common, which distances do not show."""
    rank = effective_rank(x, centred=False)
    return {"norm": mean_norm(x), "cosine": mean_cosine(x), "rank_uncentred": rank}


def mean_norm(x: Tensor) -> float:
    """Mean size of a row."""
    return float(x.flatten(1).norm(dim=1).mean())


def mean_cosine(x: Tensor) -> float:
    """Mean cosine over all pairs of rows: zero where directions are random, one where all have one."""
    unit = torch.nn.functional.normalize(_some(x).double(), dim=1)
    return float((unit.sum(0).square().sum() - unit.square().sum()) / (len(unit) * (len(unit) - 1)))


def beyond(x: Tensor, other: Tensor) -> float:
    """Share of elements outside of the range that the same element has in another set."""
    low, high = other.aminmax(dim=0)
    return float(((x < low) | (x > high)).double().mean())


def distance_to(x: Tensor, other: Tensor) -> float:
    """Mean distance of a row to the nearest one of another set: zero for copies."""
    return float(_distances(x, other).amin(1).mean())


def density_and_coverage(x: Tensor, other: Tensor) -> tuple[float, float]:
    """Density and coverage of another set's neighbourhoods by this one's rows.

    The neighbourhood of a row reaches to the fifth nearest of its own set. Density is in how many of them a
    row of x lies, over five: one on average where both sets are drawn alike, zero elsewhere. Coverage is the
    share of those that hold a row of x: 1 − 2⁻⁵ where both are drawn alike and as large, little where few
    rows are repeated.

    Source: Naeem et al. 2020, Reliable fidelity and diversity metrics for generative models.
    """
    own, k = _distances(_some(other), other), min(_NEIGHBOURS, len(other) - 1)
    reach = own.kthvalue(1 + k, dim=1).values  # the nearest is the row itself
    inside = _distances(x, other) <= reach
    return float(inside.double().sum(1).mean() / k), float(inside.any(0).double().mean())


def told_apart(x: Tensor, other: Tensor) -> float:
    """Accuracy with which a fresh classifier tells rows of two sets, as many of each, that it has not seen.

    One half: it cannot. Ridge regression, cross-validated, on the elements, their sizes, squares and products
    in units of their deviation.

    Source: Lopez-Paz and Oquab 2017, Revisiting classifier two-sample tests.
    """
    count = min(len(x), len(other))
    rows = torch.cat([_some(x)[:count], _some(other)[:count]]).double()
    label = torch.ones(2 * count, dtype=torch.float64)
    label[count:] = -1
    fold, right = torch.arange(2 * count) % _FOLDS, 0
    for k in range(_FOLDS):
        unseen, seen = fold == k, fold != k
        deviation, mean = torch.std_mean(rows[seen], 0)
        z = (rows - mean) / deviation.clamp_min(torch.finfo(rows.dtype).tiny)
        inner, square, size = z @ z.T / z.shape[1], z.square(), z.abs()
        kernel = inner + (square @ square.T / 2 + size @ size.T) / z.shape[1] + (1 + inner).square()
        ridge = _RIDGE * torch.eye(int(seen.sum()), dtype=torch.float64)
        weights = torch.linalg.solve(kernel[seen][:, seen] + ridge, label[seen])
        right += int((kernel[unseen][:, seen] @ weights * label[unseen] > 0).sum())
    return right / (2 * count)


def _distances(x: Tensor, other: Tensor) -> Tensor:
    rows = x.flatten(1), other.flatten(1)
    return torch.cdist(*rows, compute_mode="donot_use_mm_for_euclid_dist")


def _some(x: Tensor) -> Tensor:
    if len(x) < 2:
        raise ShapeError(f"sets of 2 rows or more are compared, got {len(x)}")
    return x.flatten(1)
