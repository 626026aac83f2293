"""Errors of estimated parameters, from the size of the torque's errors and their correlation over time."""

from collections.abc import Iterable
from functools import reduce

import torch
from torch import Tensor
from torch.nn.functional import pad

from sidegan.identification.fit import Fit, TorqueErrors
from sidegan.identification.gather import Gathered, residual_of
from sidegan.identification.sums import Sums

_MOST_SPENT = 0.5  # of the samples may count as spent on parameters; beyond, the variance is a guess anyway
_LAGS = 0.25  # of a piece: longer ones have too few pairs


def torque_errors(data: Gathered, fit: Fit) -> TorqueErrors:
    """Size and correlation over time of each joint's torque errors, from the residuals of a fit.

    Residuals are smaller than errors, as parameters were chosen to make them so: the parameters' share of
    each joint's samples is taken off.
    """
    sums = data.sums
    inflation = inflation_of(residual_of(data.model, x, fit.parameters) for x in data.pieces)
    share = torch.einsum("pq,jpq->j", fit.inverse, sums.information)
    spent = fit.weights.square() * share * inflation
    variance = sums.squares(fit.parameters) / (sums.weight - spent.clamp_max(_MOST_SPENT * sums.weight))
    return TorqueErrors(variance, inflation)


def covariance_of(sums: Sums, fit: Fit, errors: TorqueErrors) -> Tensor:
    """Covariance of the parameters' errors, (P, P).

    It is P (Σ_j w_j⁴ σ_j² κ_j A_j + prior) P with P the inverse, A_j the joint's information and κ_j the
    inflation: right for any weights, also those that do not fit the errors.

    Source: White 1980 for the form; Geyer 1992 for the effective number of samples.
    """
    factors = fit.weights.square().square() * errors.variance * errors.inflation
    middle = torch.einsum("j,jpq->pq", factors, sums.information) + fit.prior
    covariance = fit.inverse @ middle @ fit.inverse
    return (covariance + covariance.T) / 2


def inflation_of(residuals: Iterable[Tensor]) -> Tensor:
    """Samples that weigh as much as one, 1 + 2 Σ ρ_k ≥ 1, (J,), with ρ the residuals' autocorrelation.

    The residuals come in pieces (S, J) without gaps. The sum over lags ends before the first one without a
    positive correlation. After a low-pass that is too much by a tenth or so, which makes up for what the
    parameters have taken out of the residuals at the motion's own frequencies.

    Source: after Geyer 1992, Practical Markov chain Monte Carlo, initial positive sequence.
    """
    parts = [_products(r) for r in residuals]
    longest = max(len(products) for products, _ in parts)
    products = reduce(torch.add, [pad(one, (0, 0, 0, longest - len(one))) for one, _ in parts])
    pairs = reduce(torch.add, [pad(count, (0, longest - len(count))) for _, count in parts])
    rho = products / pairs.clamp_min(1)[:, None]
    rho = rho / torch.where(rho[0] > 0, rho[0], torch.ones_like(rho[0]))
    return 2 * (rho * (rho > 0).cumprod(0))[1:].sum(0) + 1


def _products(r: Tensor) -> tuple[Tensor, Tensor]:
    """Sums of r_t r_{t+k} of a piece, (K, J), and how many terms each has, (K,)."""
    count = len(r)
    lags = max(1, int(_LAGS * count))
    spectrum = torch.fft.rfft(r, 2 * count, dim=0)
    products = torch.fft.irfft(spectrum.abs().square(), 2 * count, dim=0)[:lags]
    return products, torch.arange(count, count - lags, -1, dtype=torch.float64)
