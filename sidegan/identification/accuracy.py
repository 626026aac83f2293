"""How wrong estimated parameters may be."""

import torch
from torch import Tensor

from sidegan.identification.fit import Fit, TorqueErrors
from sidegan.identification.gather import Gathered, Linear, residual_of
from sidegan.identification.residuals import correlation
from sidegan.identification.sums import Sums

_MOST_SPENT = 0.5  # of the samples may count as spent on parameters; beyond, the variance is a guess anyway


def torque_errors(model: Linear, gathered: Gathered, fit: Fit) -> TorqueErrors:
    """Size and correlation over time of each joint's torque errors, from the residuals of a fit.

    Residuals are smaller than errors, as parameters were chosen to make them so: the parameters' share of
    each joint's samples is taken off.
    """
    if fit.errors is not None:
        return fit.errors
    sums = gathered.sums
    limit = torch.full_like(fit.weights, torch.inf) if fit.limit is None else fit.limit
    found = correlation(residual_of(model, x, fit.parameters).clamp(-limit, limit) for x in gathered.kept)
    variance = fit.variance
    if variance is None:
        share = torch.einsum("pq,jpq->j", fit.inverse, sums.information)
        spent = fit.weights.square() * share * found.inflation
        variance = sums.squares(fit.parameters) / (sums.weight - spent.clamp_max(_MOST_SPENT * sums.weight))
    return TorqueErrors(variance, found.inflation, found.first)


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
