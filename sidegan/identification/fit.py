"""Weighted least squares on sums, and the errors of what it finds."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array
from sidegan.errors import ShapeError
from sidegan.identification.gather import Gathered, residual_of
from sidegan.identification.sums import Sums, solve

LEAST = 1e-6  # information on each parameter beside the samples': what they do not tell stays at zero

_LEAST_RESIDUAL = 1e-6  # of a joint's torque: near what the sums resolve, and less than any sensor does
_REPETITIONS = 20
_SETTLED = 1e-3  # relative change of a weight that no longer matters
_MOST_SPENT = 0.5  # of the samples may count as spent on parameters; beyond, the variance is a guess anyway
_LAGS = 0.25  # of a piece: longer ones have too few pairs


class TorqueErrors(NamedTuple):
    """Errors of the measured torque, from residuals."""

    variance: Array  # of each joint [N²·m² or N²], (J,)
    inflation: Array  # samples that weigh as much as one independent one, (J,)


class Fit(NamedTuple):
    """Parameters that a method fitted."""

    parameters: Array  # θ, (P,)
    inverse: Array  # of the weighted information and the prior, (P, P): P of recursive least squares
    weights: Array  # what each joint's equations were multiplied with, (J,)
    prior: Array  # information that did not come from the samples, (P, P)
    standard: Array | None = None  # link parameters and terms, (F,), where the method gives them
    errors: TorqueErrors | None = None  # where they are not those of these parameters' residuals


def least_squares(sums: Sums, least: float = LEAST, weights: Array | None = None) -> Fit:
    """Least squares with a prior of information ``least`` on each parameter; joints alike without weights.

    That is recursive least squares with P₀ = I / least and π₀ = 0 after all samples.

    Source: Ljung 1999, System Identification, 11.2.
    """
    weights = np.ones_like(sums.energy) if weights is None else weights
    parameters, inverse = solve(*sums.weighted(weights), least)
    return Fit(parameters, inverse, weights, least * np.eye(len(parameters)))


def reweighted(sums: Sums, least: float = LEAST) -> Fit:
    """Weighted least squares with weights 1 / residual of each joint, repeated until they settle.

    That is the maximum of the likelihood for Gaussian errors with a variance per joint. The usual single
    repetition leaves a joint that others had drowned with too small a weight.

    Source: Gautier, Poignet 2001, Extended Kalman filtering and weighted least squares dynamic
    identification of robot (one repetition).
    """
    fit = least_squares(sums, least)
    for _ in range(_REPETITIONS):
        residual = np.sqrt(sums.squares(fit.parameters) / sums.weight)
        before, fit = fit, least_squares(sums, least, 1 / np.maximum(residual, least_residual(sums)))
        if np.allclose(fit.weights, before.weights, rtol=_SETTLED, atol=0):
            break
    return fit


def least_residual(sums: Sums) -> Array:
    """Smallest residual [N·m or N] of each joint that is taken seriously, (J,)."""
    torque = np.sqrt(sums.energy / sums.weight)
    if not torque.max() > 0:
        raise ShapeError("all torques are zero: their residuals give no weights")
    return _LEAST_RESIDUAL * np.where(torque > 0, torque, torque.max())


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
