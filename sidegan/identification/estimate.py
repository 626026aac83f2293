"""Estimate a model's parameters and their errors from measurements, by a named method."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array
from sidegan.errors import ConfigError
from sidegan.identification.consistent import consistent
from sidegan.identification.fit import Fit, covariance_of, least_squares, reweighted, torque_errors
from sidegan.identification.gather import Gathered, Reach, gather
from sidegan.identification.measurements import Samples
from sidegan.identification.model import TorqueModel
from sidegan.identification.sums import Sums, condition

# Fit of samples, with the strength of the pull towards the description for methods that have one.
METHODS: dict[str, Callable[[TorqueModel, Gathered, float | None], Fit]] = {
    "ols": lambda _model, data, _strength: least_squares(data.sums),
    "weighted": lambda _model, data, _strength: reweighted(data.sums),
    "consistent": consistent,
}


@dataclass(frozen=True, eq=False)
class Estimate:
    """Estimated parameters of a model and their errors."""

    method: str  # of ``METHODS``
    names: tuple[str, ...]  # of the parameters, (P,)
    parameters: Array  # θ, (P,)
    covariance: Array  # of the parameters, (P, P), due to torque errors; errors of states are not included
    weights: Array  # weight of each joint's equations, (J,)
    inflation: Array  # samples per independent sample, (J,)
    condition: float  # of the weighted, scaled regressor; infinite if some direction is not excited
    samples: int  # number of samples, each of all joints
    reach: Reach  # how far and how fast the joints moved
    sums: Sums  # over the samples; allow a fit with other weights
    standard: Array | None = None  # in ``TorqueModel.standard_names``' order, (F,); consistent method only

    @property
    def deviation(self) -> Array:
        """Standard deviation of each parameter's error, (P,)."""
        return np.sqrt(np.maximum(self.covariance.diagonal(), 0))

    @property
    def certainty(self) -> Array:
        """Inverse standard deviation of an independent sample's torque, (J,)."""
        residual = np.sqrt(self.sums.squares(self.parameters) / self.sums.weight)
        return 1 / (residual * np.sqrt(self.inflation))


def estimate(
    method: str, model: TorqueModel, measurements: Samples, strength: float | None = None
) -> Estimate:
    """Parameters of a model from one or several recordings, by one of ``METHODS``.

    ``strength`` is that of ``consistent``'s pull.

    Raises:
        ConfigError: when the method is unknown.
    """
    if method not in METHODS:
        raise ConfigError(f"estimator is {method!r}, expected one of {', '.join(METHODS)}")
    data = gather(model, measurements)
    fit = METHODS[method](model, data, strength)
    errors = fit.errors or torque_errors(model, data, fit)
    return Estimate(
        method=method,
        names=tuple(model.names),
        parameters=fit.parameters,
        covariance=covariance_of(data.sums, fit, errors),
        weights=fit.weights,
        inflation=errors.inflation,
        condition=condition(data.sums.weighted(fit.weights)[0]),
        samples=int(data.sums.weight),
        reach=data.reach,
        sums=data.sums,
        standard=fit.standard,
    )
