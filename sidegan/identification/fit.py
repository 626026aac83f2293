"""Weighted least squares on sums, and what an estimator hands back."""

import math
from typing import NamedTuple

import torch
from torch import Tensor

from sidegan.errors import ConfigError, ShapeError
from sidegan.identification.sums import Sums, solve

_LEAST_RESIDUAL = 1e-6  # of a joint's torque: near what the sums resolve, and less than any sensor does
LEAST_INFORMATION = 1e-200  # of a prior that was forgotten: keeps the covariance finite
_REPETITIONS = 20
_SETTLED = 1e-3  # relative change of a weight that no longer matters


class TorqueErrors(NamedTuple):
    """Errors of the measured torque, as residuals tell them.

    Attributes:
        variance: of each joint [N²·m² or N²], (J,).
        inflation: how many samples tell as much as one independent one, (J,).
        first: correlation of neighbours in time, (J,).
    """

    variance: Tensor
    inflation: Tensor
    first: Tensor


class Fit(NamedTuple):
    """What an estimator found.

    Attributes:
        parameters: θ, (P,).
        inverse: of the weighted information and the prior, (P, P).
        weights: what each joint's equations were multiplied with, (J,).
        prior: information that did not come from the samples, (P, P).
        variance: of each joint's errors, (J,), where it is not that of the residuals.
        limit: residuals beyond it do not count as such, (J,).
        standard: link parameters and terms, (F,), where the estimator gives them.
        errors: of the torque, where the residuals of these parameters would not tell them.
    """

    parameters: Tensor
    inverse: Tensor
    weights: Tensor
    prior: Tensor
    variance: Tensor | None = None
    limit: Tensor | None = None
    standard: Tensor | None = None
    errors: TorqueErrors | None = None


def positive(name: str, value: float, most: float = math.inf) -> None:
    """Refuse a setting that is not a finite number above zero and up to ``most``."""
    if not (math.isfinite(value) and 0 < value <= most):
        upto = f" up to {most:g}" if math.isfinite(most) else ""
        raise ConfigError(f"{name} is {value}, expected a finite number above zero{upto}")


def least_squares(sums: Sums, weights: Tensor, least: float) -> Fit:
    """Weighted least squares with a prior of information ``least`` on each parameter."""
    parameters, inverse = solve(*sums.weighted(weights), least)
    return Fit(parameters, inverse, weights, least * torch.eye(len(parameters), dtype=torch.float64))


def reweighted(sums: Sums, least: float) -> Fit:
    """Weighted least squares with weights 1 / residual of each joint, repeated until they settle.

    Raises:
        ShapeError: when there is no torque at all.
    """
    found = least_squares(sums, torch.ones_like(sums.energy), least)
    for _ in range(_REPETITIONS):
        before, found = found, least_squares(sums, weights_of(sums, found.parameters), least)
        if torch.allclose(found.weights, before.weights, rtol=_SETTLED, atol=0):
            break
    return found


def weights_of(sums: Sums, parameters: Tensor) -> Tensor:
    """One over the root mean square of each joint's residual, (J,), bounded where that is nothing."""
    count = sums.weight.clamp_min(LEAST_INFORMATION)
    return 1 / torch.maximum((sums.squares(parameters) / count).sqrt(), least_residual(sums))


def least_residual(sums: Sums) -> Tensor:
    """Smallest residual [N·m or N] of each joint that is taken seriously, (J,).

    Raises:
        ShapeError: when there is no torque at all.
    """
    torque = (sums.energy / sums.weight.clamp_min(LEAST_INFORMATION)).sqrt()
    if not torque.max() > 0:
        raise ShapeError("all torques are zero: their residuals give no weights")
    return _LEAST_RESIDUAL * torch.where(torque > 0, torque, torque.max())
