"""Errors of estimated parameters, from the size of the torque's errors and their correlation over time."""

from collections.abc import Iterable

import numpy as np

from sidegan.base.arrays import Array
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
    share = np.einsum("pq,jpq->j", fit.inverse, sums.information)
    spent = np.square(fit.weights) * share * inflation
    variance = sums.squares(fit.parameters) / (sums.weight - np.minimum(spent, _MOST_SPENT * sums.weight))
    return TorqueErrors(variance, inflation)


def covariance_of(sums: Sums, fit: Fit, errors: TorqueErrors) -> Array:
    """Covariance of the parameters' errors, (P, P).

    It is P (Σ_j w_j⁴ σ_j² κ_j A_j + prior) P with P the inverse, A_j the joint's information and κ_j the
    inflation: right for any weights, also those that do not fit the errors.

    Source: White 1980 for the form; Geyer 1992 for the effective number of samples.
    """
    factors = fit.weights**4 * errors.variance * errors.inflation
    middle = np.einsum("j,jpq->pq", factors, sums.information) + fit.prior
    covariance = fit.inverse @ middle @ fit.inverse
    return (covariance + covariance.T) / 2


def spread_of(y: Array, covariance: Array) -> Array:
    """Variance of torques, summed over samples, (J,), of a regressor (S, J, P) and a covariance (P, P)."""
    rows = y.transpose(1, 2, 0)
    return np.maximum((covariance @ rows * rows).sum((1, 2)), 0)


def inflation_of(residuals: Iterable[Array]) -> Array:
    """Samples that weigh as much as one, 1 + 2 Σ ρ_k ≥ 1, (J,), with ρ the residuals' autocorrelation.

    The residuals come in pieces (S, J) without gaps. The sum over lags ends before the first one without a
    positive correlation. After a low-pass that is too much by a tenth or so, which makes up for what the
    parameters have taken out of the residuals at the motion's own frequencies.

    Source: after Geyer 1992, Practical Markov chain Monte Carlo, initial positive sequence.
    """
    parts = [_products(r) for r in residuals]
    longest = max(len(products) for products, _ in parts)
    products = np.sum([np.pad(one, ((0, longest - len(one)), (0, 0))) for one, _ in parts], 0)
    pairs = np.sum([np.pad(count, (0, longest - len(count))) for _, count in parts], 0)
    rho = products / np.maximum(pairs, 1)[:, None]
    rho = rho / np.where(rho[0] > 0, rho[0], 1.0)
    return 2 * (rho * (rho > 0).cumprod(0))[1:].sum(0) + 1


def _products(r: Array) -> tuple[Array, Array]:
    """Sums of r_t r_{t+k} of a piece, (K, J), and how many terms each has, (K,)."""
    count = len(r)
    lags = max(1, int(_LAGS * count))
    spectrum = np.fft.rfft(r, 2 * count, axis=0)
    products = np.fft.irfft(np.square(np.abs(spectrum)), 2 * count, axis=0)[:lags]
    return products, np.arange(count, count - lags, -1)
