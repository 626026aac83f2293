"""Methods that need no more than the sums over the samples."""

import math
from dataclasses import dataclass, fields
from typing import ClassVar

import torch
from torch import Tensor

from sidegan.identification.fit import Fit, flat, positive, recursive, reweighted
from sidegan.identification.gather import Gathered
from sidegan.identification.sums import Sums, solve


@dataclass(frozen=True)
class Ols:
    """Least squares with equal weights; directions that no sample excites stay at zero."""

    prior: float = 1e6
    forgetting: ClassVar[float] = 1.0
    rereads: ClassVar[bool] = False  # whether the samples are walked through more than once

    def __post_init__(self) -> None:
        for one in fields(self):
            if one.type is float:
                positive(one.name, getattr(self, one.name), 1.0 if one.name == "forgetting" else math.inf)

    def fit(self, data: Gathered) -> Fit:
        """Parameters of least squares."""
        return recursive(data.sums, data.samples, self.prior)


@dataclass(frozen=True)
class Weighted(Ols):
    """Least squares with joint j's equations over the size of its residual, repeated until that settles.

    Source: Gautier 1997, Dynamic identification of robots with power model (IDIM-WLS).
    """

    def fit(self, data: Gathered) -> Fit:
        """Parameters of largest likelihood for Gaussian errors with a variance per joint."""
        return recursive(data.sums, data.samples, self.prior, weighted=True)


@dataclass(frozen=True)
class Recursive(Ols):
    """Recursive least squares: samples of age k count forgetting^k as much."""

    forgetting: float = 1.0  # type: ignore[misc]
    weighted: bool = False

    def fit(self, data: Gathered) -> Fit:
        """Parameters after the last sample."""
        return recursive(data.sums, data.samples, self.prior, self.forgetting, self.weighted)


@dataclass(frozen=True)
class Essential(Ols):
    """Weighted least squares on the parameters that the samples can tell; the others are held at zero.

    The parameter of the largest relative deviation is dropped, again and again, while that is more than
    ``ratio`` times the smallest and the residual's squares grow by no more than ``loss``.

    Source: Pham, Gautier 1991, Essential parameters of robots.
    """

    ratio: float = 30.0
    loss: float = 0.02

    def fit(self, data: Gathered) -> Fit:
        """Parameters of which the dropped ones are exactly zero, and so are their errors."""
        sums = data.sums
        full = reweighted(sums, 1 / self.prior)
        squares = full.weights.square()
        most = (1 + self.loss) * float(squares @ sums.squares(full.parameters))
        kept, fit = torch.arange(data.model.count), full
        while len(kept) > 1:
            relative = fit.inverse.diagonal()[kept].sqrt() / fit.parameters[kept].abs()
            if relative.max() <= self.ratio * relative.min():
                break
            fewer = kept[torch.arange(len(kept)) != relative.argmax()]
            smaller = restricted(sums, full.weights, fewer, 1 / self.prior)
            if float(squares @ sums.squares(smaller.parameters)) > most:
                break
            kept, fit = fewer, smaller
        return fit


def restricted(sums: Sums, weights: Tensor, kept: Tensor, least: float) -> Fit:
    """Weighted least squares in which only the parameters of some indices are not zero."""
    information, moment = sums.weighted(weights)
    parameters, inverse = torch.zeros_like(moment), torch.zeros_like(information)
    prior = torch.zeros_like(information)
    square = kept[:, None], kept
    parameters[kept], inverse[square] = solve(information[square], moment[kept], least)
    prior[square] = flat(len(kept), least)
    return Fit(parameters, inverse, weights, prior)
