"""Weighted and recursive least squares on sums."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from sidegan.errors import ConfigError, ShapeError
from sidegan.identification.gather import Gathered
from sidegan.identification.sums import Sums, solve

_LEAST_RESIDUAL = 1e-6  # of a joint's torque: near what the sums resolve, and less than any sensor does
LEAST_INFORMATION = 1e-200  # of a prior that was forgotten: keeps the covariance finite
_REPETITIONS = 20
_SETTLED = 1e-3  # relative change of a weight that no longer matters


class TorqueErrors(NamedTuple):
    """Errors of the measured torque, from residuals."""

    variance: Tensor  # of each joint [N²·m² or N²], (J,)
    inflation: Tensor  # samples that weigh as much as one independent one, (J,)


class Fit(NamedTuple):
    """Parameters that a method fitted."""

    parameters: Tensor  # θ, (P,)
    # of the weighted information and the prior, (P, P): the P matrix of recursive least squares; as in the
    # paper it follows from where the samples were, not from how large their errors are
    inverse: Tensor
    weights: Tensor  # what each joint's equations were multiplied with, (J,)
    prior: Tensor  # information that did not come from the samples, (P, P)
    standard: Tensor | None = None  # link parameters and terms, (F,), where the method gives them
    errors: TorqueErrors | None = None  # where they are not those of these parameters' residuals


def flat(count: int, least: float) -> Tensor:
    """Information (P, P) of a prior that is as weak on each parameter."""
    return least * torch.eye(count, dtype=torch.float64)


def least_squares(sums: Sums, weights: Tensor, least: float) -> Fit:
    """Weighted least squares with a prior of information ``least`` on each parameter."""
    parameters, inverse = solve(*sums.weighted(weights), least)
    return Fit(parameters, inverse, weights, flat(len(parameters), least))


def reweighted(sums: Sums, least: float) -> Fit:
    """Weighted least squares with weights 1 / residual of each joint, repeated until they settle.

    That is the maximum of the likelihood for Gaussian errors with a variance per joint. The usual single
    repetition leaves a joint that others had drowned with too small a weight.

    Source: Gautier, Poignet 2001, Extended Kalman filtering and weighted least squares dynamic
    identification of robot (one repetition).
    """
    fit = least_squares(sums, torch.ones_like(sums.energy), least)
    for _ in range(_REPETITIONS):
        before, fit = fit, least_squares(sums, weights_of(sums, fit.parameters), least)
        if torch.allclose(fit.weights, before.weights, rtol=_SETTLED, atol=0):
            break
    return fit


def recursive(sums: Sums, samples: int, prior: float, forgetting: float = 1.0, weighted: bool = False) -> Fit:
    """Recursive least squares with P₀ = prior · I and π₀ = 0 after all samples, in information form.

    With λ = 1 that is batch least squares with the prior's rows √(1/prior) π = 0; with λ < 1 it is the
    classical recursion, in which the prior is forgotten like a sample: samples of age k have to count λ^k in
    the sums already. Joints count as in ``reweighted``, or alike.

    Source: Ljung 1999, System Identification, 11.2.
    """
    least = max(forgetting**samples / prior, LEAST_INFORMATION)
    if weighted:
        return reweighted(sums, least)
    return least_squares(sums, torch.ones_like(sums.energy), least)


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


@dataclass(frozen=True)
class LeastSquares:
    """Recursive least squares of all joints alike, or with joint j's equations over the size of its residual.

    Directions that no sample excites stay at zero.

    Source: Gautier 1997, Dynamic identification of robots with power model (IDIM-WLS), for the weights.
    """

    prior: float = 1e6  # P₀ = prior · I
    forgetting: float = 1.0  # samples of age k count forgetting^k as much
    weighted: bool = False

    def __post_init__(self) -> None:
        for name, most in (("prior", math.inf), ("forgetting", 1.0)):
            value = getattr(self, name)
            if not (math.isfinite(value) and 0 < value <= most):
                upto = "" if math.isinf(most) else f" up to {most:g}"
                raise ConfigError(f"{name} is {value}, expected a finite number above zero{upto}")

    def fit(self, data: Gathered) -> Fit:
        """Parameters after the last sample."""
        return recursive(data.sums, data.samples, self.prior, self.forgetting, self.weighted)
