"""Recursive least squares in information form, for any number of joints and samples."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from sidegan.errors import ConfigError, ShapeError

_ROUNDING = 16  # an eigenvalue below 16 p ε of the largest is rounding of the sums, not information
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
        shape = (joints, parameters_count)
        self._sums = _Sums(
            information=torch.zeros(*shape, parameters_count, dtype=torch.float64),
            moment=torch.zeros(shape, dtype=torch.float64),
            energy=torch.zeros(joints, dtype=torch.float64),
            weight=torch.zeros((), dtype=torch.float64),
        )

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
        chunk = _sums(regressor.detach().double(), torque.detach().double(), self.forgetting)
        if not all(x.isfinite().all() for x in chunk):
            raise ShapeError(
                "the regressor or the torque holds a value that is not finite or too large to square"
            )
        past = self.forgetting ** len(torque)
        self._sums = _Sums(*(past * old + new for old, new in zip(self._sums, chunk)))
        self.samples += len(torque)

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
        information = torch.einsum("j,jpq->pq", w.square(), self._sums.information)
        moment = torch.einsum("j,jp->p", w.square(), self._sums.moment)
        least = max(self.forgetting**self.samples / self.prior, _LEAST)
        parameters, covariance = _solve(information, moment, least)
        squares = self._squares(parameters)
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

    def _squares(self, parameters: Tensor) -> Tensor:
        """Sum of squared residuals of each joint, (J,); resolved to about 1e-13 of the torque's squares."""
        s = self._sums
        squares = s.energy - 2 * s.moment @ parameters + s.information @ parameters @ parameters
        return squares.clamp_min(0)


class _Sums(NamedTuple):
    information: Tensor  # (J, p, p)
    moment: Tensor  # (J, p)
    energy: Tensor  # (J,)
    weight: Tensor  # () number of samples, each less by its age


def _sums(y: Tensor, tau: Tensor, forgetting: float) -> _Sums:
    age = torch.arange(len(tau) - 1, -1, -1, dtype=torch.float64, device=tau.device)
    decay = forgetting**age
    if forgetting < 1:
        root = decay.sqrt()
        y, tau = y * root[:, None, None], tau * root[:, None]
    rows, torque = y.transpose(0, 1), tau.T[..., None]
    moment = (rows.mT @ torque)[..., 0]
    return _Sums(*(x.cpu() for x in (rows.mT @ rows, moment, tau.square().sum(0), decay.sum())))


def _solve(information: Tensor, moment: Tensor, least: float) -> tuple[Tensor, Tensor]:
    """Solution (p,) and inverse (p, p) of information + least · I, also where the former is singular.

    The columns are scaled to unit information first (kilograms and kilogram square metres differ by
    orders of magnitude, which is not lack of excitation). Eigenvalues at the rounding of the sums are
    then taken as no information at all, so that such directions stay at the prior instead of at noise
    divided by noise. What is left is written as rows R with Rᵀ R = information, and the singular values
    of R add the prior in the parameters' own units: no inverse of the ill-conditioned matrix is formed.
    """
    scale = information.diagonal().sqrt()
    scale = torch.where(scale > 0, scale, torch.ones_like(scale))
    eigenvalues, vectors = torch.linalg.eigh(information / scale[:, None] / scale)
    rounding = _ROUNDING * len(moment) * torch.finfo(moment.dtype).eps
    kept = eigenvalues > rounding * eigenvalues[-1].clamp_min(0)
    root, vectors = eigenvalues[kept].sqrt(), vectors[:, kept]
    rows = root[:, None] * vectors.T * scale
    right = vectors.T @ (moment / scale) / root
    u, s, vt = torch.linalg.svd(rows, full_matrices=True)
    inverse = 1 / (_padded(s.square(), len(moment)) + least)
    parameters = vt.T @ (inverse * _padded(s * (u.T @ right), len(moment)))
    return parameters, (vt.T * inverse) @ vt


def _padded(x: Tensor, length: int) -> Tensor:
    return torch.cat([x, x.new_zeros(length - len(x))])
