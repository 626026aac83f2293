"""How diverse a set of trajectories is, and how like another: what offsets, copies and sizes do not fool.

A set is rows of any shape, (N, …): coefficients [rad/s], or the logarithm of diag(YᵀY).
"""

import logging

import numpy as np

from sidegan.base.arrays import Array, flatten, split
from sidegan.errors import ShapeError

_NOISE_BATCHES = 10  # the paper averages over ten noise batches
_NUMBERS = 2_000_000  # that are held at once: 16 MB
_PAIRED = 5_000  # rows, all pairs of which are looked at
_EXACT = 20_000  # rows, each of which is compared with all others
_SAMPLED = 500  # rows that stand for more than those
_NEIGHBOURS = 5  # k of density and coverage, as their authors have it
_FOLDS = 10  # of the classifier's cross-validation
_RIDGE = 0.1  # of its least squares
_NOTHING = 1e-12  # a shorter row has no direction

log = logging.getLogger(__name__)


def diversity(c: Array, diagonal: Array) -> dict[str, float]:
    """The paper's two mean distances, over batches, and two measures that modes cannot fool.

    Of coefficients, (N, J, H, 2), and the diagonals of YᵀY, (N, p). Of very large sets they are estimates
    from a sample, which is logged. A single trajectory has none.
    """
    if len(c) < 2:
        return {}
    if len(c) > _EXACT:
        log.info("diversity of %d trajectories is estimated from a sample of them", len(c))
    batch = max(2, len(c) // _NOISE_BATCHES)
    pairs = [
        (mean_distance(x), mean_distance(y))
        for x, y in zip(split(c, batch), split(diagonal, batch))
        if len(x) > 1
    ]
    distance, distance_diagonal = np.array(pairs).mean(0).tolist()
    return {
        "distance": distance,
        "distance_diagonal": distance_diagonal,
        "nearest": nearest_distance(c),
        "rank": effective_rank(c),
    }


def mean_distance(x: Array) -> float:
    """Mean Euclidean distance over all pairs of rows, N ≥ 2 rows of any shape (the paper's diversity).

    Of more than 5,000 rows, over the pairs of that many of them.
    """
    from scipy.spatial.distance import pdist

    rows = _rows(x)
    return float(pdist(rows[_sample(len(rows), _PAIRED)] if len(rows) > _PAIRED else rows).mean())


def nearest_distance(x: Array) -> float:
    """Mean distance of a row to its nearest other row: zero when samples repeat themselves.

    Of more than 20,000 rows, the mean over 500 of them, each with its nearest one among all.
    """
    rows = _rows(x)
    chosen = _sample(len(rows), _SAMPLED) if len(rows) > _EXACT else np.arange(len(rows))
    nearest = []
    for part in split(chosen, max(1, _NUMBERS // len(rows))):
        distances = _distances(rows[part], rows)
        distances[np.arange(len(part)), part] = np.inf
        nearest.append(distances.min(1))
    return float(np.concatenate(nearest).mean())


def _sample(count: int, size: int) -> Array:
    """Indices of some of so many rows, the same each time."""
    return np.random.default_rng(0).permutation(count)[:size]


def effective_rank(x: Array, centred: bool = True) -> float:
    """Number of directions that the rows span: exp of the entropy of the covariance's eigenvalues.

    Of the second moments' where the mean is not taken off: one, where a common offset is all that there is.

    Source: Roy and Vetterli 2007, on the covariance instead of the singular values.
    """
    rows = _rows(x)
    middle = rows.mean(0) if centred else np.zeros_like(rows[0])
    parts = (part - middle for part in split(rows, max(1, _NUMBERS // rows.shape[1])))
    moments = sum((away.T @ away for away in parts), np.zeros(()))
    eigenvalues = np.maximum(np.linalg.eigvalsh(moments / len(rows)), 0)
    total = eigenvalues.sum()
    rounding = len(rows) * np.finfo(float).eps * max(-rows.min(), rows.max())  # of the mean
    if total <= rounding**2 * rows.shape[1]:  # all rows are one
        return 0.0
    share = eigenvalues[eigenvalues > 0] / total
    return float(np.exp(-(share * np.log(share)).sum()))


def proportions(x: Array) -> dict[str, float]:
    """Size, cosine and uncentred rank of a set: what it has in common, which distances do not show."""
    return {
        "norm": float(np.linalg.norm(flatten(x, 1), axis=1).mean()),
        "cosine": mean_cosine(x),
        "rank_uncentred": effective_rank(x, centred=False),
    }


def mean_cosine(x: Array) -> float:
    """Mean cosine over all pairs of rows: zero where directions are random, one where all have one."""
    rows = _rows(x)
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
    own = _distances(_rows(other), other)
    k = min(_NEIGHBOURS, len(other) - 1)
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
    rows = np.concatenate([_rows(x)[:count], _rows(other)[:count]])
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


def _rows(x: Array) -> Array:
    if len(x) < 2:
        raise ShapeError(f"a set needs at least 2 rows, got {len(x)}")
    return flatten(x, 1)
