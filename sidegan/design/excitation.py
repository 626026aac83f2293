"""How exciting a trajectory is, and how diverse a set of them."""

import logging
from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array, flatten, split
from sidegan.errors import ShapeError
from sidegan.motion.dynamics import RigidBody, gram
from sidegan.motion.trajectory import Trajectory

log = logging.getLogger(__name__)

NOISE_BATCHES = 10  # the paper averages over ten noise batches
_AT_ONCE = 100  # rows whose distances to all others are held
_NUMBERS = 10_000_000  # that are held at once: 80 MB
_PAIRED = 5_000  # rows, all pairs of which are looked at
_EXACT = 20_000  # rows, each of which is compared with all others
_SAMPLED = 500  # rows that stand for more than those


@dataclass(frozen=True)
class Excitation:
    """Excitation of B trajectories."""

    # eigenvalues of YᵀY / T in an orthonormal basis of the identifiable subspace, ascending, (B, p); rounding
    # can leave the smallest slightly below zero
    spectrum: Array
    diagonal: Array  # diagonal of YᵀY / T over the base columns, (B, p)

    @property
    def eigenvalue_fitness(self) -> Array:
        """Condition number of YᵀY, (B,); infinite for a trajectory that leaves a direction unexcited."""
        low, high = self.spectrum[:, 0], self.spectrum[:, -1]
        return _ratio(high, low, self.spectrum.shape[1])

    @property
    def diagonal_fitness(self) -> Array:
        """Largest over smallest diagonal element of YᵀY over the base columns, (B,)."""
        return _ratio(self.diagonal.max(1), self.diagonal.min(1), 1)


def _ratio(high: Array, low: Array, errors: int) -> Array:
    """Ratio of high to low, infinite where low is no more than so many rounding errors of high."""
    told = low > errors * np.finfo(float).eps * high
    return np.divide(high, low, out=np.full_like(high, np.inf), where=told)


def excitation_of(body: RigidBody, grams: Array) -> Excitation:
    """Excitation of Gram matrices of the base regressor, (B, p, p)."""
    c = body.base.subspace
    return Excitation(np.linalg.eigvalsh(c.T @ grams @ c), np.linalg.diagonal(grams))


def excite(body: RigidBody, trajectory: Trajectory, c: Array, samples: int = 80) -> Excitation:
    """Excitation of trajectories with coefficients [rad/s], (B, J, H, 2)."""
    trajectory.check(c)
    return excitation_of(body, gram(body, trajectory, c, samples))


def diversity(c: Array, excitation: Excitation) -> dict[str, float]:
    """The paper's two mean distances, over batches, and two measures that modes cannot fool.

    Of very large sets they are estimates from a sample, which is logged. A single trajectory has none.
    """
    if len(c) < 2:
        return {}
    if len(c) > _EXACT:
        log.info("diversity of %d trajectories is estimated from a sample of them", len(c))
    batch = max(2, len(c) // NOISE_BATCHES)
    pairs = [
        (mean_distance(x), mean_distance(y))
        for x, y in zip(split(c, batch), split(excitation.diagonal, batch))
        if len(x) > 1
    ]
    coefficients, diagonal = np.array(pairs).mean(0).tolist()
    return {
        "distance": coefficients,
        "distance_diagonal": diagonal,
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
    nearest, batch = np.empty(len(chosen)), max(1, min(_AT_ONCE, _NUMBERS // len(rows)))
    for found, part in zip(split(nearest, batch), split(chosen, batch)):
        found[:] = _nearest(rows, part)  # in place: small results between large ones would hold their memory
    return float(nearest.mean())


def _nearest(rows: Array, chosen: Array) -> Array:
    """Distance of each chosen row, (K,), to the nearest other of all rows (N, D), (K,)."""
    from scipy.spatial.distance import cdist

    distances = cdist(rows[chosen], rows)
    distances[np.arange(len(chosen)), chosen] = np.inf
    return distances.min(1)


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
    parts = (part - middle for part in split(rows, _NUMBERS // rows.shape[1]))
    moments = sum((away.T @ away for away in parts), np.zeros(()))
    eigenvalues = np.maximum(np.linalg.eigvalsh(moments / len(rows)), 0)
    total = eigenvalues.sum()
    rounding = len(rows) * np.finfo(float).eps * max(-rows.min(), rows.max())  # of the mean
    if total <= rounding**2 * rows.shape[1]:  # all rows are one
        return 0.0
    share = eigenvalues[eigenvalues > 0] / total
    return float(np.exp(-(share * np.log(share)).sum()))


def _rows(x: Array) -> Array:
    if len(x) < 2:
        raise ShapeError(f"diversity needs at least 2 rows, got {len(x)}")
    return flatten(x, 1)
