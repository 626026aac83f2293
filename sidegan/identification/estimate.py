"""One door to all estimators: a method's name, a model and measurements to parameters with their errors."""

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

# Samples, and the strength of the pull towards the description where there is one, to a fit.
METHODS: dict[str, Callable[[Gathered, float | None], Fit]] = {
    "ols": lambda data, _: least_squares(data.sums),
    "weighted": lambda data, _: reweighted(data.sums),
    "consistent": consistent,
}


@dataclass(frozen=True, eq=False)
class Estimate:
    """Estimated parameters of a model, with what is known about their errors."""

    method: str  # how they were found
    names: tuple[str, ...]  # of the parameters, (P,)
    parameters: Array  # θ, (P,)
    covariance: Array  # of their errors, (P, P), for errors of the torque; those of states are not in it
    weights: Array  # what each joint's equations were multiplied with, (J,)
    inflation: Array  # samples that weigh as much as one independent one, (J,)
    condition: float  # of the weighted, scaled regressor; infinite when a direction is not excited at all
    samples: int  # number of samples of all joints
    reach: Reach  # how far and how fast the joints moved
    sums: Sums  # over the samples, from which other weights can be tried
    standard: Array | None = None  # as ``TorqueModel.standard_names``, (F,), of the consistent method

    @property
    def deviation(self) -> Array:
        """Standard deviation of each parameter's error, (P,)."""
        return np.sqrt(np.maximum(self.covariance.diagonal(), 0))

    @property
    def certainty(self) -> Array:
        """One over the deviation of an independent sample's torque, (J,)."""
        residual = np.sqrt(self.sums.squares(self.parameters) / self.sums.weight)
        return 1 / (residual * np.sqrt(self.inflation))


def estimate(
    method: str, model: TorqueModel, measurements: Samples, strength: float | None = None
) -> Estimate:
    """Parameters of a model from measurements, by one of ``METHODS``.

    Samples are of one recording or several. The strength is that of ``consistent``'s pull.

    Raises:
        ConfigError: when the method is unknown.
    """
    if method not in METHODS:
        raise ConfigError(f"estimator is {method!r}, expected one of {', '.join(METHODS)}")
    data = gather(model, measurements)
    fit = METHODS[method](data, strength)
    errors = fit.errors or torque_errors(data, fit)
    return Estimate(
        method=method,
        names=tuple(model.names),
        parameters=fit.parameters,
        covariance=covariance_of(data.sums, fit, errors),
        weights=fit.weights,
        inflation=errors.inflation,
        condition=condition(data.sums.weighted(fit.weights)[0]),
        samples=data.samples,
        reach=data.reach,
        sums=data.sums,
        standard=fit.standard,
    )
