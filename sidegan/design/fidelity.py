"""Diversity of a set of trajectories and its similarity to another, robust to offsets, copies and sizes.

A set has rows of any shape, (N, …): coefficients [rad/s], or the logarithm of diag(YᵀY).
"""

import logging

import numpy as np

from sidegan.base.arrays import Array, flatten, split
from sidegan.errors import ShapeError

_NOISE_BATCHES = 10  # the paper averages over ten noise batches
_NUMBERS = 2_000_000  # largest temporary array: 16 MB
_PAIRED = 5_000  # most rows for distances between all pairs
_EXACT = 20_000  # most rows for nearest neighbours of all
_SAMPLED = 500  # rows to sample from larger sets
_NEIGHBOURS = 5  # k of density and coverage, as in the source
_FOLDS = 10  # of the classifier's cross-validation
_RIDGE = 0.1  # of the classifier
_NOTHING = 1e-12  # norm below which a row has no direction

_log = logging.getLogger(__name__)


def diversity(c: Array, diagonal: Array) -> dict[str, float]:
    """The paper's two mean distances, over batches, and two measures that a few modes cannot fool.

    Of coefficients, (N, J, H, 2), and the diagonals of YᵀY, (N, p). Very large sets are sampled, which is
    logged. Empty for a single trajectory.
    """
    if len(c) < 2:
        return {}
    if len(c) > _EXACT:
        _log.info("diversity of %d trajectories is estimated from a sample of them", len(c))
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
    """Mean Euclidean distance over all pairs of N ≥ 2 rows of any shape (the paper's diversity).

    Over the pairs of a sample of 5,000 rows if there are more.
    """
    from scipy.spatial.distance import pdist

    rows = _rows(x)
    return float(pdist(rows[_sample(len(rows), _PAIRED)] if len(rows) > _PAIRED else rows).mean())


def nearest_distance(x: Array) -> float:
    """Mean distance of a row to its nearest other row: zero when samples repeat.

    With more than 20,000 rows, the mean over a sample of 500, each with its nearest neighbour among all.
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
    """Indices of a reproducible random sample of ``count`` rows."""
    return np.random.default_rng(0).permutation(count)[:size]


def effective_rank(x: Array, centred: bool = True) -> float:
    """Number of directions that the rows span: exp of the entropy of the covariance's eigenvalues.

    Not ``centred``, it uses the second moments: 1 if all rows are a common offset.

    Source: Roy and Vetterli 2007, on the covariance instead of the singular values.
    """
    rows = _rows(x)
    centre = rows.mean(0) if centred else np.zeros_like(rows[0])
    parts = (part - centre for part in split(rows, max(1, _NUMBERS // rows.shape[1])))
    moments = sum((part.T @ part for part in parts), np.zeros(()))
    eigenvalues = np.maximum(np.linalg.eigvalsh(moments / len(rows)), 0)
    total = eigenvalues.sum()
    rounding = len(rows) * np.finfo(float).eps * max(-rows.min(), rows.max())  # of the mean
    if total <= rounding**2 * rows.shape[1]:  # all rows are equal
        return 0.0
    share = eigenvalues[eigenvalues > 0] / total
    return float(np.exp(-(share * np.log(share)).sum()))


def proportions(x: Array) -> dict[str, float]:
    """Size, cosine and uncentred rank of a set: common offsets, which distances do not show."""
    return {
        "norm": float(np.linalg.norm(flatten(x, 1), axis=1).mean()),
        "cosine": mean_cosine(x),
        "rank_uncentred": effective_rank(x, centred=False),
    }


def mean_cosine(x: Array) -> float:
    """Mean cosine over all pairs of rows: 0 for random directions, 1 if all are the same."""
    rows = _rows(x)
    unit = rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), _NOTHING)
    return float((np.square(unit.sum(0)).sum() - np.square(unit).sum()) / (len(unit) * (len(unit) - 1)))


def beyond(x: Array, other: Array) -> float:
    """Share of elements outside the range that the same element has in another set."""
    return float(((x < other.min(0)) | (x > other.max(0))).mean())


def distance_to(x: Array, other: Array) -> float:
    """Mean distance of a row to the nearest row of another set: zero for copies."""
    return float(_distances(x, other).min(1).mean())


def density_and_coverage(x: Array, other: Array) -> tuple[float, float]:
    """Density and coverage of another set's neighbourhoods by the rows of x.

    The neighbourhood of a row of ``other`` reaches to its fifth nearest neighbour in ``other``. Density is
    the mean number of neighbourhoods that a row of x lies in, over five: 1 if both sets have the same
    distribution, 0 if they are far apart. Coverage is the share of neighbourhoods with a row of x: 1 − 2⁻⁵
    for the same distribution and size, small if x repeats few rows.

    Source: Naeem et al. 2020, Reliable fidelity and diversity metrics for generative models.
    """
    within = _distances(_rows(other), other)
    k = min(_NEIGHBOURS, len(other) - 1)
    reach = np.partition(within, k, axis=1)[:, k]  # the nearest row is the row itself
    inside = _distances(x, other) <= reach
    return float(inside.sum(1).mean() / k), float(inside.any(0).mean())


def classifier_accuracy(x: Array, other: Array) -> float:
    """Cross-validated accuracy of a classifier that tells rows of two sets apart; 0.5: it cannot.

    Ridge regression on standardised elements, their sizes, squares and products, with equally many rows of
    each set.

    Source: Lopez-Paz and Oquab 2017, Revisiting classifier two-sample tests.
    """
    count = min(len(x), len(other))
    rows = np.concatenate([_rows(x)[:count], _rows(other)[:count]])
    label = np.repeat([1.0, -1.0], count)
    fold = np.arange(2 * count) % _FOLDS
    right = 0
    for k in range(_FOLDS):
        unseen, seen = fold == k, fold != k
        deviation = np.maximum(rows[seen].std(0, ddof=1), np.finfo(float).tiny)
        z = (rows - rows[seen].mean(0)) / deviation
        inner = z @ z.T / z.shape[1]
        square = np.square(z)
        size = np.abs(z)
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
