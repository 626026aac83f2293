"""Losses that keep a batch of trajectories as diverse as the seed set."""

import torch
from torch import Tensor, nn

from sidegan.excitation import mean_distance

_DIRECTIONS = 48  # most principal directions whose spread is kept; a batch of 100 resolves no more
_RIDGE = 1e-3  # keeps the covariance of a small batch invertible
_SHARE = 0.9  # of the seeds' mean distance, up to which distance is rewarded
_PAIRS = 500  # seeds whose mean distance stands for all


class Diversity(nn.Module):
    """Compares batches (B, J, H, 2) with a seed set (N, J, H, 2)."""

    directions: Tensor

    def __init__(self, seeds: Tensor) -> None:
        super().__init__()
        x = seeds.double().flatten(1)
        values, vectors = torch.linalg.eigh(torch.cov(x.T).reshape(x.shape[1], x.shape[1]))
        count = min(_DIRECTIONS, x.shape[1], len(x) - 1)
        whitening = vectors[:, -count:] / values[-count:].clamp_min(1e-9).sqrt()
        self.register_buffer("directions", whitening.float())
        self.target = _SHARE * mean_distance(x[:_PAIRS])

    def spread_loss(self, c: Tensor) -> Tensor:
        """Divergence of the batch's Gaussian from the seeds', per direction; 0 for equal covariances."""
        y = c.flatten(1) @ self.directions
        eye = torch.eye(y.shape[1]).to(y)
        covariance = torch.cov(y.T).reshape(eye.shape) + _RIDGE * eye
        return 0.5 * (covariance.trace() / len(eye) - 1 - torch.logdet(covariance) / len(eye))

    def distance_loss(self, c: Tensor) -> Tensor:
        """Missing share of the mean distance between two trajectories, 0 when it is that of the seeds."""
        return (1 - torch.pdist(c.flatten(1)).mean() / self.target).clamp_min(0)
