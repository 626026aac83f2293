"""Loss terms that keep a batch of trajectories as diverse as a seed set."""

import torch
from torch import Tensor

from sidegan.design.excitation import mean_distance
from sidegan.gan.terms import Batch, Formula

_PAIRS = 500  # seeds whose mean distance stands for all
_BATCHES = 8  # of seeds, whose mean rank stands for that of any batch
_TINY = 1e-9  # share of the variance below which a direction does not count


def distance(weight: float, target: float) -> Formula:
    """Missing share of the mean distance between two trajectories, 0 when it is that of the seeds."""

    def loss(batch: Batch) -> Tensor:
        return (1 - torch.pdist(batch.coefficients.flatten(1)).mean() / target).clamp_min(0)

    return Formula(weight, loss)


def rank(weight: float, target: float) -> Formula:
    """Missing log effective rank of a batch, 0 when it is that of as many seeds."""
    return Formula(weight, lambda batch: (target - _entropy(batch.coefficients.flatten(1))).clamp_min(0))


def distance_target(seeds: Tensor) -> float:
    """Mean distance [rad/s] up to which distance is rewarded: that of the seeds."""
    return mean_distance(seeds.double().flatten(1)[:_PAIRS])


def rank_target(seeds: Tensor, batch: int) -> float:
    """Log effective rank up to which rank is rewarded: that of batches of so many seeds (N, J, H, 2)."""
    x, size = seeds.double().flatten(1), min(batch, len(seeds))
    parts = [part for part in x.split(size)[:_BATCHES] if len(part) == size]
    return float(torch.stack([_entropy(part) for part in parts]).mean())


def _entropy(x: Tensor) -> Tensor:
    """Entropy of the shares of variance in the principal directions of rows: log of their effective rank."""
    values = torch.linalg.eigvalsh(_covariance(x)).clamp_min(0)
    share = (values / values.sum().clamp_min(torch.finfo(x.dtype).tiny)).clamp_min(_TINY)
    return -(share * share.log()).sum()


def _covariance(x: Tensor) -> Tensor:
    """Covariance (D, D) of rows (N, D), also of a single column."""
    return torch.cov(x.T).reshape(x.shape[1], x.shape[1])
