"""Least squares that outliers do not drag along."""

import logging
import math
from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor

from sidegan.identification.accuracy import torque_errors
from sidegan.identification.fit import Fit, flat, least_residual, reweighted, weights_of
from sidegan.identification.gather import Gathered, residual_of, weighted_sums
from sidegan.identification.linear import Ols
from sidegan.identification.measurements import pieces
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
    rereads: ClassVar[bool] = True

    def fit(self, data: Gathered) -> Fit:
        """Parameters after walking through the measurements until they settle."""
        parameters = reweighted(data.sums, 1 / self.prior).parameters
        scale, least = 1 / weights_of(data.sums, parameters), least_residual(data.sums)
        for _ in range(_REPETITIONS):
            sums, found, squares, inside = self._walk(data, parameters, scale)
            before, (parameters, inverse) = parameters, solve(*sums.weighted(1 / scale), 1 / self.prior)
            moved = ((parameters - before).abs() / inverse.diagonal().sqrt()).max()
            size = torch.maximum(found, least)
            resized = (size / scale - 1).abs().max()
            scale = size
            if max(moved, resized) < _SETTLED:
                break
        else:
            _log.warning("huber has not settled after %d walks through the samples", _REPETITIONS)
        _, inverse = solve(*data.sums.weighted(1 / scale), 1 / self.prior)
        fit = Fit(parameters, inverse, 1 / scale, flat(len(parameters), 1 / self.prior))
        variance = scale.square() * squares / inside.clamp_min(0.1).square()
        return fit._replace(errors=torque_errors(data, fit, variance, self.threshold * scale))

    def _walk(self, data: Gathered, parameters: Tensor, scale: Tensor) -> tuple[Sums, Tensor, Tensor, Tensor]:
        """Sums, σ after this walk, mean of ψ², and of ψ′, the share within the threshold, (J,) each."""
        sums, squares = no_sums(data.model.joints, data.model.count), torch.zeros_like(scale)
        inside = torch.zeros_like(scale)
        for part in pieces(data.source):
            size = (residual_of(data.model, part, parameters) / scale).abs()
            sums = sums.plus(weighted_sums(data.model, part, (self.threshold / size).clamp_max(1)))
            squares += size.clamp_max(self.threshold).square().sum(0)
            inside += (size <= self.threshold).double().sum(0)
        squares, inside = squares / data.samples, inside / data.samples
        return sums, scale * (squares / _expected(self.threshold)).sqrt(), squares, inside


def _expected(k: float) -> float:
    """Mean of ψ(x)² for standard normal x."""
    beyond = math.erfc(k / math.sqrt(2)) / 2
    density = math.exp(-k * k / 2) / math.sqrt(2 * math.pi)
    return 1 - 2 * beyond - 2 * k * density + 2 * k * k * beyond
