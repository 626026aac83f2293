"""Recursive least squares in information form, for any number of joints and samples."""

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from sidegan.errors import ConfigError, ShapeError
from sidegan.identification.sums import Sums, no_sums, solve, sums_of

_LEAST_RESIDUAL = 1e-6  # of a joint's torque: near what the sums resolve, and less than any sensor does
_REPETITIONS = 20
_SETTLED = 1e-3  # relative change of a weight that no longer matters
_LEAST = 1e-200  # information of a prior that was forgotten: keeps the covariance finite


@dataclass(frozen=True, eq=False)
class Identified:
    """An identified model.

    Attributes:
        parameters: estimated base parameters π̂, (p,).
        covariance: the P matrix of RLS, (Σ λ^age Yᵀ W Y + λ^S I / prior)⁻¹, (p, p). As in the paper it
            tells where the samples were, not how large their errors are: see ``error_covariance``.
        samples: number S of samples of all joints.
        weights: what each joint's equations were multiplied with, W = diag(weights²), (J,).
        residual: root mean square of τ − Y π̂ over the samples [N·m or N], (J,).
        variance: variance σ² of the weighted residuals, p degrees of freedom spent; infinite when no
            equation is left over.
    """

    parameters: Tensor
    covariance: Tensor
    samples: int
    weights: Tensor
    residual: Tensor
    variance: float

    @property
    def error_covariance(self) -> Tensor:
        """Covariance σ² P of the parameters' errors, (p, p), for independent errors of σ / weight.

        It means something when the weights fit the joints, as after ``identify_weighted``.
        """
        return self.variance * self.covariance


class Rls:
    """Recursive least squares of τ = Y π with P₀ = prior · I and π₀ = 0.

    With λ = 1 the estimate is that of batch least squares with the prior's rows √(1/prior) π = 0; with
    λ < 1 that of the classical recursion (the prior is forgotten like a sample), in chunks of any size.
    The information A_j = Σ λ^age Y_jᵀ Y_j of each joint is summed apart, and so are Y_jᵀ τ_j and τ_jᵀ τ_j:
    weights and residuals per joint then need no second pass over the samples.

    Args:
        parameters_count: number of parameters p.
        joints: number of joints J.
        prior: variance of each parameter before any sample.
        forgetting: λ in (0, 1].

    Raises:
        ConfigError: when the prior is not finite and positive, or λ not in (0, 1].

    Source: Ljung 1999, System Identification, 11.2.
    """

    def __init__(
        self, parameters_count: int, joints: int, prior: float = 1e6, forgetting: float = 1.0
    ) -> None:
        if not (math.isfinite(prior) and prior > 0):
            raise ConfigError(f"prior is {prior}, expected a finite positive variance")
        if not 0 < forgetting <= 1:
            raise ConfigError(f"forgetting factor is {forgetting}, expected a number in (0, 1]")
        self.prior, self.forgetting, self.samples = prior, forgetting, 0
        self._sums = no_sums(joints, parameters_count)

    def update(self, regressor: Tensor, torque: Tensor) -> None:
        """Take in a chunk of samples, oldest first.

        Args:
            regressor: Y, (S, J, p).
            torque: τ [N·m or N], (S, J).

        Raises:
            ShapeError: when a shape does not fit or a value is not finite; the chunk is then left out.
        """
        joints, parameters = self._sums.moment.shape
        if regressor.shape != (len(torque), joints, parameters) or torque.shape != (len(torque), joints):
            found = f"regressor {tuple(regressor.shape)} and torque {tuple(torque.shape)}"
            raise ShapeError(f"{found}, expected (S, {joints}, {parameters}) and (S, {joints})")
        chunk = sums_of(regressor.detach().double(), torque.detach().double(), self.forgetting)
        self._sums = self._sums.times(self.forgetting ** len(torque)).plus(chunk)
        self.samples += len(torque)

    def absorb(self, sums: Sums) -> None:
        """Take in the sums over other samples, each with weight one.

        Raises:
            ConfigError: when the recursion forgets: sums have no order in time.
            ShapeError: when the sums are of other parameters or joints.
        """
        if self.forgetting < 1:
            raise ConfigError(f"sums cannot be added with forgetting factor {self.forgetting}, expected 1")
        if sums.information.shape != self._sums.information.shape:
            found, expected = (tuple(x.information.shape) for x in (sums, self._sums))
            raise ShapeError(f"sums of information are {found}, expected {expected}")
        self._sums = self._sums.plus(sums)
        self.samples += round(float(sums.weight))

    @property
    def sums(self) -> Sums:
        """Sums over all samples so far."""
        return self._sums

    @property
    def estimate(self) -> Tensor:
        """Estimated parameters π̂ with equal weights, (p,)."""
        return self.solve().parameters

    @property
    def covariance(self) -> Tensor:
        """The P matrix with equal weights, (p, p)."""
        return self.solve().covariance

    def solve(self, weights: Tensor | None = None) -> Identified:
        """The model identified from all samples so far.

        Args:
            weights: what each joint's equations are multiplied with, positive, (J,); ones when None.

        Raises:
            ShapeError: when the weights do not fit.
        """
        joints = len(self._sums.energy)
        w = torch.ones(joints, dtype=torch.float64) if weights is None else weights.double().cpu()
        if w.shape != (joints,) or not ((w > 0) & w.isfinite()).all():
            raise ShapeError(f"weights are {w.tolist()}, expected {joints} positive numbers")
        information, moment = self._sums.weighted(w)
        least = max(self.forgetting**self.samples / self.prior, _LEAST)
        parameters, covariance = solve(information, moment, least)
        squares = self._sums.squares(parameters)
        spare = float(self._sums.weight) * joints - len(parameters)
        variance = float((w.square() * squares).sum()) / spare if spare > 0 else math.inf
        residual = (squares / self._sums.weight.clamp_min(_LEAST)).sqrt()
        return Identified(parameters, covariance, self.samples, w, residual, variance)

    def solve_weighted(self) -> Identified:
        """The model identified with weights 1 / residual of each joint, repeated until they settle.

        That is the maximum of the likelihood for Gaussian errors with a variance per joint. The usual
        single repetition leaves a joint that others had drowned with too small a weight.

        Raises:
            ShapeError: when there is no torque at all.

        Source: Gautier, Poignet 2001, Extended Kalman filtering and weighted least squares dynamic
        identification of robot (one repetition).
        """
        torque = (self._sums.energy / self._sums.weight.clamp_min(_LEAST)).sqrt()
        if not torque.max() > 0:
            raise ShapeError("all torques are zero: their residuals give no weights")
        floor = _LEAST_RESIDUAL * torch.where(torque > 0, torque, torque.max())
        found = self.solve()
        for _ in range(_REPETITIONS):
            before, found = found, self.solve(1 / torch.maximum(found.residual, floor))
            if torch.allclose(found.weights, before.weights, rtol=_SETTLED, atol=0):
                break
        return found
