"""Losses of a generator: weighted functions of a batch of its trajectories."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn.functional import normalize, softplus

from sidegan.base.arrays import Array, flatten, split
from sidegan.design.fidelity import mean_cosine, mean_distance

_COMPARED = 500  # seeds for the target of the mean distance
_BATCHES = 8  # batches of seeds for the target of the rank
_MOST_COSINE = 0.03  # upper bound of the target of the mean cosine
_TINY = 1e-9  # share of the squares below which a direction does not count


@dataclass
class Batch:
    """Generated trajectories, as inputs of losses."""

    coefficients: Tensor  # [rad/s], (B, J, H, 2)
    images: Tensor  # of the coefficients, (B, 2, …)
    free: Tensor  # coefficients before the box, (B, J, H, 2)
    convert: Callable[[], Tensor]

    @cached_property
    def features(self) -> Tensor:
        """Features that the converter predicts, (B, p), made by the first loss that needs them.

        Made earlier, gradients would add up in another order, and round differently.
        """
        return self.convert()


Value = Callable[[Batch], Tensor]  # a loss without its weight, 0-dimensional


class Loss(NamedTuple):
    """A weighted loss of a generator."""

    weight: float
    value: Value
    name: str = "other"  # under which a training logs it


class Adversary(nn.Module):
    """A discriminator and its examples: rewards a generator for samples that it takes for examples.

    Args:
        network: maps views to logits (B,).
        examples: real views, (N, …).
        view: maps a batch to views, (B, …).
        penalty: weight of the discriminator's squared gradient at examples. Without it, a generator as fast
            as ours chases the discriminator with all samples at once.

    Source: Mescheder et al. 2018, Which training methods for GANs do actually converge? (penalty R₁).
    """

    def __init__(self, network: nn.Module, examples: Tensor, view: Value, penalty: float = 0.0) -> None:
        super().__init__()
        self.network, self.view, self.penalty = network, view, penalty
        self.examples = nn.Buffer(examples.contiguous(), persistent=False)

    def forward(self, batch: Batch) -> Tensor:
        """Loss of the generator, −log D, 0-dimensional."""
        return softplus(-self.network(self.view(batch))).mean()

    def own_loss(self, rows: Tensor, batch: Batch) -> Tensor:
        """Loss of the discriminator on rows of the examples and a batch without gradient, 0-dimensional."""
        real = self.examples[rows].requires_grad_(self.penalty > 0)
        on_real, on_fake = self.network(real), self.network(self.view(batch))
        loss = softplus(-on_real).mean() + softplus(on_fake).mean()
        if not self.penalty:
            return loss
        (slope,) = torch.autograd.grad(on_real.sum(), real, create_graph=True)
        return loss + self.penalty / 2 * slope.square().flatten(1).sum(1).mean()


def missing_distance(seeds: Array) -> Value:
    """Missing share of the mean distance between trajectories, 0 if it reaches that of the seeds."""
    target = mean_distance(seeds[:_COMPARED])
    return lambda batch: (1 - torch.pdist(batch.coefficients.flatten(1)).mean() / target).clamp_min(0)


def common_offset(seeds: Array) -> Value:
    """Excess of the mean cosine between trajectories over the seeds', or over 0.03 if theirs is larger.

    It shows a common offset of a batch, which distances and covariances do not detect. It is measured before
    the box, since the gradient vanishes for coefficients at the box's edge. Seeds may have a larger offset
    than a generator needs, as where home is at the edge of a range.
    """
    target = min(max(mean_cosine(seeds), 0.0), _MOST_COSINE)

    def excess(batch: Batch) -> Tensor:
        count = len(batch.free)
        squares = normalize(batch.free.flatten(1)).sum(0).square().sum()
        return ((squares - count) / (count * (count - 1)) - target).clamp_min(0)

    return excess


def missing_rank(seeds: Array, size: int, share: float = 1.0) -> Value:
    """Missing log effective rank of a batch, 0 if it reaches a share of that of equally many seeds."""
    size = min(size, len(seeds))
    parts = split(flatten(seeds, 1)[: _BATCHES * size], size)
    ranks = [_log_rank(torch.tensor(part)) for part in parts if len(part) == size]
    target = float(torch.stack(ranks).mean()) + math.log(share)
    return lambda batch: (target - _log_rank(batch.coefficients.flatten(1))).clamp_min(0)


def _log_rank(x: Tensor) -> Tensor:
    """Log effective rank of rows (N, D), not centred: entropy of the principal directions' shares."""
    values = torch.linalg.eigvalsh(x.T @ x / len(x)).clamp_min(0)
    share = (values / values.sum().clamp_min(torch.finfo(x.dtype).tiny)).clamp_min(_TINY)
    return -(share * share.log()).sum()
