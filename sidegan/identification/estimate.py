"""Estimate a model's parameters from measurements by a named method, and score the torques they predict."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array
from sidegan.errors import ConfigError, ShapeError
from sidegan.identification.consistent import consistent
from sidegan.identification.fit import (
    Fit,
    Gathered,
    covariance_of,
    gather,
    least_residual,
    least_squares,
    torque_errors,
    weighted_least_squares,
)
from sidegan.identification.measurements import Samples, pieces
from sidegan.identification.model import TorqueModel
from sidegan.identification.sums import Sums, condition

_CONSTANT = 1e-12  # of the largest torque: a smaller deviation is rounding, not a signal
_LEAST_SHOWN = 1e-3  # smallest error with four decimals

# Fit of samples, with the strength of the pull towards the description for methods that have one.
ESTIMATORS: dict[str, Callable[[TorqueModel, Gathered, float | None], Fit]] = {
    "ols": lambda _model, data, _strength: least_squares(data.sums),
    "weighted": lambda _model, data, _strength: weighted_least_squares(data.sums),
    "consistent": consistent,
}


@dataclass(frozen=True, eq=False)
class Estimate:
    """Estimated parameters of a model and their errors."""

    method: str  # of ``ESTIMATORS``
    names: tuple[str, ...]  # of the parameters, (P,)
    parameters: Array  # θ, (P,)
    covariance: Array  # of the parameters, (P, P), due to torque errors; errors of states are not included
    weights: Array  # weight of each joint's equations, (J,)
    inflation: Array  # samples per independent sample, (J,)
    condition: float  # of the weighted, scaled regressor without effects; infinite if a direction is idle
    samples: int  # number of samples, each of all joints
    sums: Sums  # over the samples; allow a fit with other weights
    standard: Array | None = None  # in ``TorqueModel.standard_names``' order, (F,); consistent method only

    @property
    def deviation(self) -> Array:
        """Standard deviation of each parameter's error, (P,)."""
        return np.sqrt(np.maximum(self.covariance.diagonal(), 0))

    @property
    def certainty(self) -> Array:
        """Inverse standard deviation of an independent sample's torque, (J,); finite without noise, too."""
        residual = np.sqrt(self.sums.squares(self.parameters) / self.sums.weight)
        return 1 / (np.maximum(residual, least_residual(self.sums)) * np.sqrt(self.inflation))


def estimate(
    method: str, model: TorqueModel, measurements: Samples, strength: float | None = None
) -> Estimate:
    """Parameters of a model from one or several recordings, by one of ``ESTIMATORS``.

    ``strength`` is that of ``consistent``'s pull.

    Raises:
        ConfigError: when the method is unknown.
    """
    if method not in ESTIMATORS:
        raise ConfigError(f"estimator is {method!r}, expected one of {', '.join(ESTIMATORS)}")
    data = gather(model, measurements)
    fit = ESTIMATORS[method](model, data, strength)
    errors = fit.errors or torque_errors(model, data, fit)
    excited = len(model.names) - (len(model.effects.names) if model.effects else 0)
    return Estimate(
        method=method,
        names=tuple(model.names),
        parameters=fit.parameters,
        covariance=covariance_of(data.sums, fit, errors),
        weights=fit.weights,
        inflation=errors.inflation,
        condition=condition(data.sums.weighted(fit.weights)[0][:excited, :excited]),
        samples=int(data.sums.weight),
        sums=data.sums,
        standard=fit.standard,
    )


class Score(NamedTuple):
    """Errors of predicted torques of each joint, (J,), or of each recording and joint, (K, J)."""

    nmse: Array  # mean((τ − τ̂)²) / var(τ); predicting the mean gives 1
    rmse: Array  # root mean square of τ − τ̂ [N·m or N]

    @property
    def nmse_mean(self) -> float:
        """Mean over joints."""
        return float(self.nmse.mean())

    @property
    def pooled(self) -> "Score":
        """Errors over all K recordings, (J,)."""
        return Score(self.nmse.mean(0), np.sqrt(np.square(self.rmse).mean(0)))


def score(model: TorqueModel, parameters: Array, measurements: Samples) -> Score:
    """Errors of the torques that parameters (P,) predict for measurements.

    Raises:
        ShapeError: when shapes do not fit the model, there are no samples, or a joint's torque is constant.
    """
    if parameters.shape != (len(model.names),):
        raise ShapeError(f"parameters are {parameters.shape}, the model has {len(model.names)}")
    parts = list(pieces(measurements))
    if not parts:
        raise ShapeError("there are no samples to test with")
    torque = np.concatenate([part.torque for part in parts])
    predicted = np.concatenate([model.torque(parameters, *part.inputs) for part in parts])
    variance = torque.var(0)
    squares = np.square(torque - predicted).mean(0)
    constant = np.flatnonzero(np.sqrt(variance) <= _CONSTANT * np.abs(torque).max())
    if len(constant):
        raise ShapeError(f"the torque of joints {(constant + 1).tolist()} is constant: nMSE is not defined")
    return Score(squares / variance, np.sqrt(squares))


def nmse_text(nmse: float) -> str:
    """A mean nMSE as text: four decimals, or two significant digits if it is small."""
    return f"{nmse:.4f}" if nmse >= _LEAST_SHOWN else f"{nmse:.2g}"
