"""Losses of a generator: functions of a batch of its trajectories, with weights that may change in time."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor, nn
from torch.nn.functional import softplus

from sidegan.design import physics
from sidegan.design.excitation import mean_distance
from sidegan.design.objectives import Term
from sidegan.design.penalty import Penalty
from sidegan.design.problem import Problem

_EASED = 0.67  # share of a training over which an eased weight grows
_CLEARANCE = 4.0  # times the reserve, in units of 0.25 m
_PAIRS = 500  # seeds whose mean distance stands for all
_BATCHES = 8  # of seeds, whose mean rank stands for that of any batch
_TINY = 1e-9  # share of the variance below which a direction does not count


@dataclass
class Batch:
    """Trajectories that a generator made, as losses see them; computed once, when a loss looks."""

    coefficients: Tensor  # [rad/s], (B, J, H, 2)
    draw: Callable[[], Tensor]
    convert: Callable[["Batch"], Tensor]

    @cached_property
    def images(self) -> Tensor:
        """Images of the coefficients, (B, 2, J, H)."""
        return self.draw()

    @cached_property
    def features(self) -> Tensor:
        """Features that the converter predicts, (B, p)."""
        return self.convert(self)


Value = Callable[[Batch], Tensor]  # a loss without its weight, 0-dimensional
Factor = Callable[[int, float], float]  # of a weight, in an epoch, after so much of the training (0 to 1)


def constant(epoch: int, share: float) -> float:
    """Factor of a weight that stays."""
    return 1.0


def from_epoch(start: int) -> Factor:
    """Factor of a weight that counts from an epoch on."""
    return lambda epoch, share: float(epoch >= start)


def eased(ease: float) -> Factor:
    """Factor that grows from ``ease`` to 1, geometrically."""
    return lambda epoch, share: ease ** (1 - min(1.0, share / _EASED))


@dataclass(frozen=True)
class Loss:
    """A weighted loss of a generator."""

    weight: float
    value: Value
    factor: Factor = constant


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


def predicted_failure(predictor: nn.Module) -> Value:
    """Minus the mean log probability of being valid, by a success predictor."""
    return lambda batch: -predictor(batch.coefficients).mean()


def log_ratio(log_features: Callable[[Tensor], Tensor]) -> Value:
    """Mean log ratio of the largest to the smallest feature, by a converter's ``log_features``."""

    def value(batch: Batch) -> Tensor:
        logs = log_features(batch.features)
        return (logs.amax(1) - logs.amin(1)).mean()

    return value


def missing_distance(seeds: Tensor) -> Value:
    """Missing share of the mean distance between two trajectories, 0 when it is that of the seeds."""
    target = mean_distance(seeds.double().flatten(1)[:_PAIRS])
    return lambda batch: (1 - torch.pdist(batch.coefficients.flatten(1)).mean() / target).clamp_min(0)


def missing_rank(seeds: Tensor, size: int) -> Value:
    """Missing log effective rank of a batch of a size, 0 when it is that of as many seeds (N, J, H, 2)."""
    x, size = seeds.double().flatten(1), min(size, len(seeds))
    parts = [part for part in x.split(size)[:_BATCHES] if len(part) == size]
    target = float(torch.stack([_log_rank(part) for part in parts]).mean())
    return lambda batch: (target - _log_rank(batch.coefficients.flatten(1))).clamp_min(0)


def _log_rank(x: Tensor) -> Tensor:
    """Log of the effective rank of rows (N, D): entropy of the shares of variance in principal directions."""
    covariance = torch.cov(x.T).reshape(x.shape[1], x.shape[1])  # a single column has none of its own
    values = torch.linalg.eigvalsh(covariance).clamp_min(0)
    share = (values / values.sum().clamp_min(torch.finfo(x.dtype).tiny)).clamp_min(_TINY)
    return -(share * share.log()).sum()


def violation(problem: Problem, reserve: float) -> Value:
    """Mean squared relative violation of the constraints, by exact physics.

    A share of the torque limits is kept free, and four times that share of 0.25 m. The limits on motion hold
    by the generator's last layer.
    """
    penalty = Penalty(1.0, limits=0.0, torque=reserve, distance=_CLEARANCE * reserve)

    def value(batch: Batch) -> Tensor:
        c = batch.coefficients
        return physics.violation(problem, c, penalty).to(c).mean()

    return value


def objective(problem: Problem, terms: Iterable[Term]) -> Value:
    """Sum of exact objectives over a batch; the smaller, the better."""

    def value(batch: Batch) -> Tensor:
        c = batch.coefficients
        return torch.stack([term(problem, c) for term in terms]).sum().to(c)

    return value
