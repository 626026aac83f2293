"""Losses that keep a batch of trajectories as diverse as the seed set."""

import math

import torch
from torch import Tensor, nn

from sidegan.design.excitation import mean_distance

_DIRECTIONS = 48  # most principal directions whose spread is kept; a batch of 100 resolves no more
_RIDGE = 1e-3  # keeps the covariance of a small batch invertible
_BATCH = 100
_SHARE = 0.9  # of the seeds' mean distance, up to which distance is rewarded
_RANK_SHARE = 0.957  # of the effective rank of a batch of seeds, up to which rank is rewarded
_PAIRS = 500  # seeds whose mean distance stands for all
_BATCHES = 8  # of seeds, whose mean rank stands for that of any batch
_TINY = 1e-9  # share of the variance below which a direction does not count


class Diversity(nn.Module):
    """Compares batches (B, J, H, 2) with a seed set.

    Args:
        seeds: coefficients of the seed set [rad/s], (N, J, H, 2).
        batch: B, on which the effective rank of a batch depends.
        share: of the seeds' mean distance, up to which distance is rewarded.
    """

    directions: Tensor

    def __init__(self, seeds: Tensor, batch: int = _BATCH, share: float = _SHARE) -> None:
        super().__init__()
        x = seeds.double().flatten(1)
        values, vectors = torch.linalg.eigh(torch.cov(x.T).reshape(x.shape[1], x.shape[1]))
        count = min(_DIRECTIONS, x.shape[1], len(x) - 1)
        whitening = vectors[:, -count:] / values[-count:].clamp_min(1e-9).sqrt()
        self.register_buffer("directions", whitening.float())
        self.target = share * mean_distance(x[:_PAIRS])
        parts = [part for part in x.split(batch)[:_BATCHES] if len(part) == min(batch, len(x))]
        entropy = torch.stack([_entropy(part) for part in parts]).mean()
        self.entropy = float(entropy) + math.log(_RANK_SHARE)

    def spread_loss(self, c: Tensor) -> Tensor:
        """Divergence of the batch's Gaussian from the seeds', per direction; 0 for equal covariances."""
        y = c.flatten(1) @ self.directions
        eye = torch.eye(y.shape[1]).to(y)
        covariance = torch.cov(y.T).reshape(eye.shape) + _RIDGE * eye
        return 0.5 * (covariance.trace() / len(eye) - 1 - torch.logdet(covariance) / len(eye))

    def distance_loss(self, c: Tensor) -> Tensor:
        """Missing share of the mean distance between two trajectories, 0 when it is that of the seeds."""
        return (1 - torch.pdist(c.flatten(1)).mean() / self.target).clamp_min(0)

    def rank_loss(self, c: Tensor) -> Tensor:
        """Missing log effective rank of the batch, 0 when it is that of as many seeds."""
        return (self.entropy - _entropy(c.flatten(1))).clamp_min(0)


def _entropy(x: Tensor) -> Tensor:
    """Entropy of the shares of variance in the principal directions of rows: log of their effective rank."""
    values = torch.linalg.eigvalsh(torch.cov(x.T).reshape(x.shape[1], x.shape[1])).clamp_min(0)
    share = (values / values.sum().clamp_min(torch.finfo(x.dtype).tiny)).clamp_min(_TINY)
    return -(share * share.log()).sum()
