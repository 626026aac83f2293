"""Weighted and recursive least squares on sums."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array
from sidegan.errors import ShapeError
from sidegan.identification.gather import Gathered
from sidegan.identification.sums import Sums, solve

_LEAST_RESIDUAL = 1e-6  # of a joint's torque: near what the sums resolve, and less than any sensor does
_REPETITIONS = 20
_SETTLED = 1e-3  # relative change of a weight that no longer matters


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


def least_squares(sums: Sums, least: float, weights: Array | None = None) -> Fit:
    """Least squares with a prior of information ``least`` on each parameter; joints alike without weights."""
    weights = np.ones_like(sums.energy) if weights is None else weights
    parameters, inverse = solve(*sums.weighted(weights), least)
    return Fit(parameters, inverse, weights, least * np.eye(len(parameters)))


def reweighted(sums: Sums, least: float) -> Fit:
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
    """Smallest residual [N·m or N] of each joint that is taken seriously, (J,).

    Raises:
        ShapeError: when there is no torque at all.
    """
    torque = np.sqrt(sums.energy / sums.weight)
    if not torque.max() > 0:
        raise ShapeError("all torques are zero: their residuals give no weights")
    return _LEAST_RESIDUAL * np.where(torque > 0, torque, torque.max())


@dataclass(frozen=True)
class LeastSquares:
    """Least squares of all joints alike, or weighted, each by one over the size of its residual.

    That is recursive least squares with P₀ = prior · I and π₀ = 0 after all samples. With forgetting, samples
    of age k count forgetting^k as much, and the prior is forgotten like a sample. Directions that no sample
    excites stay at zero.

    Source: Ljung 1999, System Identification, 11.2; Gautier 1997, Dynamic identification of robots with power
    model (IDIM-WLS), for the weights.
    """

    prior: float = 1e6
    forgetting: float = 1.0
    weighted: bool = False

    def fit(self, data: Gathered) -> Fit:
        """Parameters after the last sample."""
        least = self.forgetting**data.samples / self.prior
        return (reweighted if self.weighted else least_squares)(data.sums, least)
