"""Least squares that outliers do not drag along."""

import logging
import math
from dataclasses import dataclass

import torch
from torch import Tensor

from sidegan.identification.fit import Fit, least_residual, positive, reweighted, weights_of
from sidegan.identification.gather import Gathered, Linear, Samples, pieces, residual_of, weighted_sums
from sidegan.identification.linear import Ols
from sidegan.identification.sums import Sums, no_sums, solve

_log = logging.getLogger(__name__)
_REPETITIONS = 30
_SETTLED = 1e-3  # of a parameter's own deviation, and of the residuals' size: too little to matter


@dataclass(frozen=True)
class Huber(Ols):
    """Weighted least squares in which residuals beyond ``threshold`` deviations count by size, not by square.

    The deviation σ of each joint is found together with the parameters (Huber's proposal 2), so that samples
    are walked through piece by piece, once per repetition, and never sorted.

    Source: Huber 1981, Robust statistics, section 7.7.
    """

    threshold: float = 1.345

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("threshold", self.threshold)

    def fit_again(self, model: Linear, gathered: Gathered, measurements: Samples, at_once: int) -> Fit:
        """Parameters after walking through the measurements until they settle."""
        start = reweighted(gathered.sums, 1 / self.prior)
        scale, parameters = 1 / weights_of(gathered.sums, start.parameters), start.parameters
        least = least_residual(gathered.sums)
        for _ in range(_REPETITIONS):
            walk = self._walk(model, measurements, parameters, scale, at_once)
            found, inverse = solve(*walk.sums.weighted(1 / scale), 1 / self.prior)
            moved = ((found - parameters).abs() / inverse.diagonal().sqrt()).max()
            new = torch.maximum(walk.scale, least)
            resized = (new / scale - 1).abs().max()
            parameters, scale = found, new
            if max(moved, resized) < _SETTLED:
                break
        else:
            _log.warning("huber has not settled after %d walks through the samples", _REPETITIONS)
        return self._fit(parameters, scale, walk, gathered)

    def _walk(
        self, model: Linear, measurements: Samples, parameters: Tensor, scale: Tensor, at_once: int
    ) -> "_Walk":
        sums, squares = no_sums(model.joints, model.count), torch.zeros_like(scale)
        inside, samples = torch.zeros_like(scale), 0
        for part in pieces(measurements, at_once):
            size = (residual_of(model, part, parameters) / scale).abs()
            sums = sums.plus(weighted_sums(model, part, (self.threshold / size).clamp_max(1)))
            squares += size.clamp_max(self.threshold).square().sum(0)
            inside += (size <= self.threshold).double().sum(0)
            samples += len(part)
        new = scale * (squares / samples / _expected(self.threshold)).sqrt()
        return _Walk(sums, new, squares / samples, inside / samples)

    def _fit(self, parameters: Tensor, scale: Tensor, walk: "_Walk", gathered: Gathered) -> Fit:
        weights = 1 / scale
        _, inverse = solve(*gathered.sums.weighted(weights), 1 / self.prior)
        variance = scale.square() * walk.squares / walk.inside.clamp_min(0.1).square()
        flat = torch.eye(len(parameters), dtype=torch.float64) / self.prior
        return Fit(parameters, inverse, weights, flat, variance, self.threshold * scale)


@dataclass(frozen=True)
class _Walk:
    sums: Sums
    scale: Tensor  # (J,) σ after this walk
    squares: Tensor  # (J,) mean of ψ²
    inside: Tensor  # (J,) mean of ψ', the share of residuals within the threshold


def _expected(k: float) -> float:
    """Mean of ψ(x)² for standard normal x."""
    beyond = math.erfc(k / math.sqrt(2)) / 2
    density = math.exp(-k * k / 2) / math.sqrt(2 * math.pi)
    return 1 - 2 * beyond - 2 * k * density + 2 * k * k * beyond
