"""Losses of a generator: functions of a batch of its trajectories, each with its weight."""

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
from sidegan.gan.tensors import tensor

_PAIRS = 500  # seeds whose mean distance stands for all
_BATCHES = 8  # of seeds, whose mean rank stands for that of any batch
_IN_COMMON = 0.03  # mean cosine between trajectories, at most
_TINY = 1e-9  # share of the squares below which a direction does not count


@dataclass
class Batch:
    """Trajectories that a generator made, as losses see them."""

    coefficients: Tensor  # [rad/s], (B, J, H, 2)
    images: Tensor  # of the coefficients, (B, 2, …)
    free: Tensor  # coefficients before a box cuts them, (B, J, H, 2)
    convert: "Callable[[Batch], Tensor]"

    @cached_property
    def features(self) -> Tensor:
        """Features that the converter predicts, (B, p)."""
        return self.convert(self)


Value = Callable[[Batch], Tensor]  # a loss without its weight, 0-dimensional


class Loss(NamedTuple):
    """A weighted loss of a generator."""

    weight: float
    value: Value


class Adversary(nn.Module):
    """A discriminator with its examples: rewards a generator for what it takes for one of them.

    Args:
        network: logits (B,) of what it sees.
        examples: (N, …).
        view: what it sees of a batch, (B, …).
    """

    examples: Tensor

    def __init__(self, network: nn.Module, examples: Tensor, view: Value) -> None:
        super().__init__()
        self.network, self.view = network, view
        self.register_buffer("examples", examples.contiguous(), persistent=False)

    def forward(self, batch: Batch) -> Tensor:
        """Loss of the generator, −log D, 0-dimensional."""
        return softplus(-self.network(self.view(batch))).mean()

    def own_loss(self, rows: Tensor, batch: Batch) -> Tensor:
        """Loss of the discriminator on some examples and a batch without gradient, 0-dimensional."""
        on_real, on_fake = self.network(self.examples[rows]), self.network(self.view(batch))
        return softplus(-on_real).mean() + softplus(on_fake).mean()


def missing_distance(seeds: Array) -> Value:
    """Missing share of the mean distance between two trajectories, 0 when it is that of the seeds."""
    target = mean_distance(seeds[:_PAIRS])
    return lambda batch: (1 - torch.pdist(batch.coefficients.flatten(1)).mean() / target).clamp_min(0)


def common_offset(seeds: Array) -> Value:
    """Mean cosine between two trajectories beyond that of the seeds: of what all of a batch have in common.

    Distances and covariances cannot see it. It is taken before a box cuts: what all push against the box has
    no slope behind it, and would stay there. Where home is at the edge of a range seeds may have more in
    common than a generator needs.
    """
    most = min(max(mean_cosine(seeds), 0.0), _IN_COMMON)
    return lambda batch: (_mean_cosine(batch.free.flatten(1)) - most).clamp_min(0)


def _mean_cosine(x: Tensor) -> Tensor:
    """Mean cosine between two of the rows (N, D), 0-dimensional."""
    count = len(x)
    return (normalize(x).sum(0).square().sum() - count) / (count * (count - 1))


def missing_rank(seeds: Array, size: int, share: float = 1.0) -> Value:
    """Missing log effective rank of a batch of a size, 0 when it is that share of as many seeds'."""
    rows, size = flatten(seeds, 1), min(size, len(seeds))
    parts = [tensor(part) for part in split(rows[: _BATCHES * size], size) if len(part) == size]
    target = float(torch.stack([_log_rank(part) for part in parts]).mean()) + math.log(share)
    return lambda batch: (target - _log_rank(batch.coefficients.flatten(1))).clamp_min(0)


def _log_rank(x: Tensor) -> Tensor:
    """Log of the effective rank of rows (N, D): entropy of their principal directions' shares of the squares.

    No mean is taken off, so that it is one of the directions.
    """
    values = torch.linalg.eigvalsh(x.T @ x / len(x)).clamp_min(0)
    share = (values / values.sum().clamp_min(torch.finfo(x.dtype).tiny)).clamp_min(_TINY)
    return -(share * share.log()).sum()
