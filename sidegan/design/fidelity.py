"""How one set of trajectories is like another: what offsets, copies and other sizes do not fool.

A set is rows of any shape, (N, …): coefficients [rad/s], or the logarithm of diag(YᵀY).
"""

import numpy as np

from sidegan.base.arrays import Array, flatten
from sidegan.design.excitation import effective_rank
from sidegan.errors import ShapeError

_NEIGHBOURS = 5  # k of density and coverage, as their authors have it
_FOLDS = 10  # of the classifier's cross-validation
_RIDGE = 0.1  # of its least squares
_NOTHING = 1e-12  # a shorter row has no direction


def proportions(x: Array) -> dict[str, float]:
    """Size, cosine and uncentred rank of a set: what it has in common, which distances do not show."""
    rank = effective_rank(x, centred=False)
    return {"norm": mean_norm(x), "cosine": mean_cosine(x), "rank_uncentred": rank}


def mean_norm(x: Array) -> float:
    """Mean size of a row."""
    return float(np.linalg.norm(flatten(x, 1), axis=1).mean())


def mean_cosine(x: Array) -> float:
    """Mean cosine over all pairs of rows: zero where directions are random, one where all have one."""
    rows = _some(x)
    unit = rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), _NOTHING)
    return float((np.square(unit.sum(0)).sum() - np.square(unit).sum()) / (len(unit) * (len(unit) - 1)))


def beyond(x: Array, other: Array) -> float:
    """Share of elements outside of the range that the same element has in another set."""
    return float(((x < other.min(0)) | (x > other.max(0))).mean())


def distance_to(x: Array, other: Array) -> float:
    """Mean distance of a row to the nearest one of another set: zero for copies."""
    return float(_distances(x, other).min(1).mean())


def density_and_coverage(x: Array, other: Array) -> tuple[float, float]:
    """Density and coverage of another set's neighbourhoods by this one's rows.

    The neighbourhood of a row reaches to the fifth nearest of its own set. Density is in how many of them a
    row of x lies, over five: one on average where both sets are drawn alike, zero elsewhere. Coverage is the
    share of those that hold a row of x: 1 − 2⁻⁵ where both are drawn alike and as large, little where few
    rows are repeated.

    Source: Naeem et al. 2020, Reliable fidelity and diversity metrics for generative models.
    """
    own, k = _distances(_some(other), other), min(_NEIGHBOURS, len(other) - 1)
    reach = np.partition(own, k, axis=1)[:, k]  # the nearest is the row itself
    inside = _distances(x, other) <= reach
    return float(inside.sum(1).mean() / k), float(inside.any(0).mean())


def told_apart(x: Array, other: Array) -> float:
    """Accuracy with which a fresh classifier tells rows of two sets, as many of each, that it has not seen.

    One half: it cannot. Ridge regression, cross-validated, on the elements, their sizes, squares and products
    in units of their deviation.

    Source: Lopez-Paz and Oquab 2017, Revisiting classifier two-sample tests.
    """
    count = min(len(x), len(other))
    rows = np.concatenate([_some(x)[:count], _some(other)[:count]])
    label = np.repeat([1.0, -1.0], count)
    fold, right = np.arange(2 * count) % _FOLDS, 0
    for k in range(_FOLDS):
        unseen, seen = fold == k, fold != k
        deviation = np.maximum(rows[seen].std(0, ddof=1), np.finfo(float).tiny)
        z = (rows - rows[seen].mean(0)) / deviation
        inner, square, size = z @ z.T / z.shape[1], np.square(z), np.abs(z)
        kernel = inner + (square @ square.T / 2 + size @ size.T) / z.shape[1] + np.square(1 + inner)
        ridge = _RIDGE * np.eye(seen.sum())
        weights = np.linalg.solve(kernel[seen][:, seen] + ridge, label[seen])
        right += int((kernel[unseen][:, seen] @ weights * label[unseen] > 0).sum())
    return right / (2 * count)


def _distances(x: Array, other: Array) -> Array:
    from scipy.spatial.distance import cdist

    return cdist(flatten(x, 1), flatten(other, 1))


def _some(x: Array) -> Array:
    if len(x) < 2:
        raise ShapeError(f"sets of 2 rows or more are compared, got {len(x)}")
    return flatten(x, 1)
