"""How exciting a trajectory is, and how diverse a set of them."""

import logging
from dataclasses import dataclass

import torch
from torch import Tensor

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
    spectrum: Tensor
    diagonal: Tensor  # diagonal of YᵀY / T over the base columns, (B, p)

    @property
    def eigenvalue_fitness(self) -> Tensor:
        """Condition number of YᵀY, (B,); infinite for a trajectory that leaves a direction unexcited."""
        low, high = self.spectrum[:, 0], self.spectrum[:, -1]
        return _ratio(high, low, self.spectrum.shape[1])

    @property
    def diagonal_fitness(self) -> Tensor:
        """Largest over smallest diagonal element of YᵀY over the base columns, (B,)."""
        return _ratio(self.diagonal.amax(1), self.diagonal.amin(1), 1)


def _ratio(high: Tensor, low: Tensor, errors: int) -> Tensor:
    """Ratio of high to low, infinite where low is no more than so many rounding errors of high."""
    floor = errors * torch.finfo(high.dtype).eps * high
    return torch.where(low > floor, high / low.clamp_min(torch.finfo(high.dtype).tiny), torch.inf)


def excitation_of(body: RigidBody, grams: Tensor) -> Excitation:
    """Excitation of Gram matrices of the base regressor, (B, p, p)."""
    c = body.base.subspace.to(grams)
    return Excitation(torch.linalg.eigvalsh(c.T @ grams @ c), grams.diagonal(dim1=1, dim2=2))


def excite(body: RigidBody, trajectory: Trajectory, c: Tensor, samples: int = 80) -> Excitation:
    """Excitation of trajectories with coefficients [rad/s], (B, J, H, 2)."""
    trajectory.check(c)
    return excitation_of(body, gram(body, trajectory, c, samples))


def diversity(c: Tensor, excitation: Excitation) -> dict[str, float]:
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
        for x, y in zip(c.split(batch), excitation.diagonal.split(batch))
        if len(x) > 1
    ]
    coefficients, diagonal = torch.tensor(pairs, dtype=torch.float64).mean(0).tolist()
    return {
        "distance": coefficients,
        "distance_diagonal": diagonal,
        "nearest": nearest_distance(c),
        "rank": effective_rank(c),
    }


def mean_distance(x: Tensor) -> float:
    """Mean Euclidean distance over all pairs of rows, N ≥ 2 rows of any shape (the paper's diversity).

    Of more than 5,000 rows, over the pairs of that many of them.
    """
    rows = _rows(x)
    return float(torch.pdist(rows[_sample(len(rows), _PAIRED)] if len(rows) > _PAIRED else rows).mean())


def nearest_distance(x: Tensor) -> float:
    """Mean distance of a row to its nearest other row: zero when samples repeat themselves.

    Of more than 20,000 rows, the mean over 500 of them, each with its nearest one among all.
    """
    rows = _rows(x)
    chosen = _sample(len(rows), _SAMPLED) if len(rows) > _EXACT else torch.arange(len(rows))
    nearest, batch = rows.new_empty(len(chosen)), max(1, min(_AT_ONCE, _NUMBERS // len(rows)))
    for found, part in zip(nearest.split(batch), chosen.split(batch)):
        found[:] = _nearest(rows, part)  # in place: small results between large ones would hold their memory
    return float(nearest.mean())


def _nearest(rows: Tensor, chosen: Tensor) -> Tensor:
    """Distance of each chosen row, (K,), to the nearest other of all rows (N, D), (K,)."""
    distances = torch.cdist(rows[chosen], rows, compute_mode="donot_use_mm_for_euclid_dist")
    distances[torch.arange(len(chosen)), chosen] = torch.inf
    return distances.amin(1)


def _sample(count: int, size: int) -> Tensor:
    """Indices of some of so many rows, the same each time."""
    return torch.randperm(count, generator=torch.Generator().manual_seed(0))[:size]


def effective_rank(x: Tensor, centred: bool = True) -> float:
    """Number of directions that the rows span: exp of the entropy of the covariance's eigenvalues.

    Of the second moments' where the mean is not taken off: one, where a common offset is all that there is.

    Source: Roy and Vetterli 2007, on the covariance instead of the singular values.
    """
    rows = _rows(x)
    middle = rows.mean(0) if centred else torch.zeros_like(rows[0])
    parts = (part - middle for part in rows.split(_NUMBERS // rows.shape[1]))
    moments = sum((away.T @ away for away in parts), torch.zeros(()))
    eigenvalues = torch.linalg.eigvalsh(moments / len(rows)).clamp_min(0)
    total = eigenvalues.sum()
    noise = (torch.finfo(rows.dtype).eps * max(-rows.min(), rows.max())) ** 2 * rows.shape[1]
    if total <= noise:  # all rows are one, but for rounding
        return 0.0
    share = eigenvalues / total
    return float(torch.exp(-torch.special.xlogy(share, share).sum()))


def _rows(x: Tensor) -> Tensor:
    if len(x) < 2:
        raise ShapeError(f"diversity needs at least 2 rows, got {len(x)}")
    return x.reshape(len(x), -1)
