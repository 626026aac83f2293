"""Weighted least squares on sums over samples, and the errors of its parameters."""

from collections.abc import Callable, Iterable
from functools import reduce
from typing import NamedTuple, TypeAlias

import numpy as np

from sidegan.base.arrays import Array
from sidegan.errors import ShapeError
from sidegan.identification.measurements import Measurements, Samples, pieces
from sidegan.identification.model import TorqueModel, torques_of
from sidegan.identification.sums import Sums, solve, sums_of

LEAST = 1e-6  # prior information on each parameter: directions without excitation stay at zero

_LEAST_RESIDUAL = 1e-6  # share of a joint's torque: near the resolution of the sums, below any sensor's
_REPETITIONS = 20
_SETTLED = 1e-3  # relative change at which weights have converged
_MOST_SPENT = 0.5  # largest share of the degrees of freedom deducted for parameters; beyond, it is a guess
_LAGS = 0.25  # longest lag, as a share of a piece: longer lags have too few pairs


class Extended:
    """A model with further columns, which come last: ``columns(q, dq, ddq, sign)``, (S, J, K)."""

    def __init__(self, model: TorqueModel, count: int, columns: Callable[..., Array]) -> None:
        self._model = model
        self._columns = columns
        self.joints = model.joints
        self.count = model.count + count

    def regressor(self, q: Array, dq: Array, ddq: Array, sign: Array | None = None) -> Array:
        """Regressor, (S, J, P + K), of states (S, J)."""
        y = self._model.regressor(q, dq, ddq, sign)
        return np.concatenate([y, self._columns(q, dq, ddq, sign)], 2)


LinearModel: TypeAlias = TorqueModel | Extended


class Gathered(NamedTuple):
    """Samples and the sums over them that methods fit parameters to."""

    sums: Sums  # over all samples
    pieces: list[Measurements]  # without gaps


def gather(model: LinearModel, measurements: Samples) -> Gathered:
    """Sums over the measurements of one or several recordings.

    Raises:
        ShapeError: when there are no samples, or they do not fit the model or are too large.
    """
    parts = list(pieces(measurements))
    if not parts:
        raise ShapeError("there are no samples to identify from")
    with np.errstate(over="ignore"):  # the check below refuses it
        sums = reduce(Sums.plus, (_sums(model, part) for part in parts))
    if not all(np.isfinite(x).all() for x in sums):
        raise ShapeError(
            "the regressor or the torque holds a value that is not finite or too large to square"
        )
    return Gathered(sums, parts)


def residual_of(model: LinearModel, part: Measurements, parameters: Array) -> Array:
    """Residual τ − Y θ [N·m or N], (S, J), of a piece."""
    return part.torque - torques_of(model.regressor(*part.inputs), parameters)


def _sums(model: LinearModel, part: Measurements) -> Sums:
    if part.joints != model.joints:
        raise ShapeError(f"measurements have {part.joints} joints, the model has {model.joints}")
    if not isinstance(model, TorqueModel) or model.kinds or model.effects:
        return sums_of(model.regressor(*part.inputs), part.torque)
    # For rigid bodies alone the same sums need no regressor in memory.
    products = model.body.sums(*part.states, part.torque)
    information, moment, energy = products[:, :-1, :-1], products[:, :-1, -1], products[:, -1, -1]
    return Sums(information, moment, energy, part.torque.sum(0), np.array(float(len(part))))


class TorqueErrors(NamedTuple):
    """Errors of the measured torque, from residuals."""

    variance: Array  # of each joint [N²·m² or N²], (J,)
    inflation: Array  # samples per independent sample, (J,)


class Fit(NamedTuple):
    """Fitted parameters."""

    parameters: Array  # θ, (P,)
    inverse: Array  # of weighted information plus prior, (P, P): P of recursive least squares
    weights: Array  # weight of each joint's equations, (J,)
    prior: Array  # information that does not come from the samples, (P, P)
    standard: Array | None = None  # link parameters and terms, (F,), if the method gives them
    errors: TorqueErrors | None = None  # None: those of these parameters' residuals


def best_combination(sums: Sums, weights: Array, fixed: Array, free: Array) -> tuple[Array, Array, Array]:
    """Parameters (P,), fixed ones plus the best combination of free columns (P, K).

    Also its weights (K,), and their covariance (K, K) if ``weights`` are the inverse standard deviations of
    independent torques.
    """
    information, moment = sums.weighted(weights)
    if not free.size:
        return fixed, np.zeros(0), np.zeros((0, 0))
    x, inverse = solve(free.T @ information @ free, free.T @ (moment - information @ fixed), LEAST)
    return fixed + free @ x, x, inverse


def least_squares(sums: Sums, least: float = LEAST, weights: Array | None = None) -> Fit:
    """Least squares with prior information ``least`` on each parameter; joints count alike without weights.

    This equals recursive least squares with P₀ = I / least and π₀ = 0 after all samples.

    Source: Ljung 1999, System Identification, 11.2.
    """
    weights = np.ones_like(sums.energy) if weights is None else weights
    parameters, inverse = solve(*sums.weighted(weights), least)
    return Fit(parameters, inverse, weights, least * np.eye(len(parameters)))


def weighted_least_squares(sums: Sums, least: float = LEAST) -> Fit:
    """Weighted least squares with weights 1 / residual of each joint, iterated until they converge.

    This maximises the likelihood for Gaussian errors with a variance per joint. With the usual single
    iteration, joints with small torques get too little weight.

    Source: Gautier, Poignet 2001, Extended Kalman filtering and weighted least squares dynamic
    identification of robot (one repetition).
    """
    fit = least_squares(sums, least)
    for _ in range(_REPETITIONS):
        residual = np.sqrt(sums.squares(fit.parameters) / sums.weight)
        before = fit
        fit = least_squares(sums, least, 1 / np.maximum(residual, least_residual(sums)))
        if np.allclose(fit.weights, before.weights, rtol=_SETTLED, atol=0):
            break
    return fit


def least_residual(sums: Sums) -> Array:
    """Lower bound of each joint's residual in its weight [N·m or N], (J,)."""
    torque = np.sqrt(sums.energy / sums.weight)
    if not torque.max() > 0:
        raise ShapeError("all torques are zero: their residuals give no weights")
    return _LEAST_RESIDUAL * np.where(torque > 0, torque, torque.max())


def torque_errors(model: LinearModel, data: Gathered, fit: Fit) -> TorqueErrors:
    """Variance and correlation over time of each joint's torque errors, from the residuals of a fit.

    Residuals are smaller than errors, since the fit minimises them: the parameters' share of each joint's
    degrees of freedom is deducted.
    """
    sums = data.sums
    inflation = inflation_of(residual_of(model, x, fit.parameters) for x in data.pieces)
    share = np.einsum("pq,jpq->j", fit.inverse, sums.information)
    spent = np.square(fit.weights) * share * inflation
    variance = sums.squares(fit.parameters) / (sums.weight - np.minimum(spent, _MOST_SPENT * sums.weight))
    return TorqueErrors(variance, inflation)


def covariance_of(sums: Sums, fit: Fit, errors: TorqueErrors) -> Array:
    """Covariance of the parameters, (P, P).

    P (Σ_j w_j⁴ σ_j² κ_j A_j + prior) P with P the inverse, A_j joint j's information and κ_j its inflation:
    valid for any weights, including those that do not match the errors.

    Source: White 1980 for the form; Geyer 1992 for the effective number of samples.
    """
    factors = fit.weights**4 * errors.variance * errors.inflation
    middle = np.einsum("j,jpq->pq", factors, sums.information) + fit.prior
    covariance = fit.inverse @ middle @ fit.inverse
    return (covariance + covariance.T) / 2


def spread_of(y: Array, covariance: Array) -> Array:
    """Torque variance summed over samples, (J,), from a regressor (S, J, P) and a covariance (P, P)."""
    rows = y.transpose(1, 2, 0)
    return np.maximum((covariance @ rows * rows).sum((1, 2)), 0)


def inflation_of(residuals: Iterable[Array]) -> Array:
    """Samples per independent sample, 1 + 2 Σ ρ_k ≥ 1, (J,), with ρ the residuals' autocorrelation.

    The residuals come in pieces (S, J) without gaps. The sum ends before the first lag without a positive
    correlation. After a low-pass it is some 10 % too large, which compensates for the residuals that the
    fit has removed at the motion's own frequencies.

    Source: after Geyer 1992, Practical Markov chain Monte Carlo, initial positive sequence.
    """
    parts = [_products(r) for r in residuals]
    longest = max(len(products) for products, _ in parts)
    products = np.sum([np.pad(product, ((0, longest - len(product)), (0, 0))) for product, _ in parts], 0)
    pairs = np.sum([np.pad(count, (0, longest - len(count))) for _, count in parts], 0)
    rho = products / np.maximum(pairs, 1)[:, None]
    rho = rho / np.where(rho[0] > 0, rho[0], 1.0)
    return 2 * (rho * (rho > 0).cumprod(0))[1:].sum(0) + 1


def _products(r: Array) -> tuple[Array, Array]:
    """Sums of r_t r_{t+k} over a piece, (K, J), and the number of terms in each, (K,)."""
    count = len(r)
    lags = max(1, int(_LAGS * count))
    spectrum = np.fft.rfft(r, 2 * count, axis=0)
    products = np.fft.irfft(np.square(np.abs(spectrum)), 2 * count, axis=0)[:lags]
    return products, np.arange(count, count - lags, -1)
