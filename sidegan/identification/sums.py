"""Least squares on sums: all that samples say about linear parameters, in bounded memory."""

from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import pad

_CONSTANT = 1e-13  # of the mean square: a smaller variance is rounding
_ROUNDING = 16  # an eigenvalue below 16 p ε of the largest is rounding of the sums, not information


class Sums(NamedTuple):
    """Sums over samples of τ = Y θ, apart for each joint so that weights can be chosen afterwards."""

    information: Tensor  # Σ Y_jᵀ Y_j, (J, P, P)
    moment: Tensor  # Σ Y_jᵀ τ_j, (J, P)
    energy: Tensor  # Σ τ_j², (J,)
    total: Tensor  # Σ τ_j, (J,)
    weight: Tensor  # number of samples, each less by its age, ()

    def plus(self, other: "Sums", factor: float = 1.0) -> "Sums":
        """Sums over these samples, each of which then counts ``factor`` as much, and ``other``'s."""
        return Sums(*(factor * a + b for a, b in zip(self, other)))

    def weighted(self, weights: Tensor) -> tuple[Tensor, Tensor]:
        """Information (P, P) and moment (P,) of all joints, joint j's equations times ``weights[j]``."""
        squares = weights.square()
        return (
            torch.einsum("j,jpq->pq", squares, self.information),
            torch.einsum("j,jp->p", squares, self.moment),
        )

    @property
    def variance(self) -> Tensor:
        """Variance of each joint's torque, (J,); zero where it is no more than rounding of the sums."""
        mean, square = self.total / self.weight, self.energy / self.weight
        variance = square - mean.square()
        return torch.where(variance > _CONSTANT * square, variance, torch.zeros_like(variance))

    def squares(self, parameters: Tensor) -> Tensor:
        """Sum of squared residuals of each joint, (J,); resolved to about 1e-13 of the torque's squares."""
        squares = self.energy - 2 * self.moment @ parameters + self.information @ parameters @ parameters
        return squares.clamp_min(0)

    def nmse(self, parameters: Tensor) -> Tensor:
        """Mean squared residual over the torque's variance, (J,); infinite where it is constant."""
        squares, variance = self.squares(parameters) / self.weight, self.variance
        return torch.where(variance > 0, squares / variance, torch.inf)


def no_sums(joints: int, parameters: int) -> Sums:
    """Sums over no samples."""
    shapes = (joints, parameters, parameters), (joints, parameters), (joints,), (joints,), ()
    return Sums(*(torch.zeros(shape, dtype=torch.float64) for shape in shapes))


def sums_of(y: Tensor, tau: Tensor, forgetting: float = 1.0) -> Sums:
    """Sums over samples, oldest first, of a regressor (S, J, P) and torque (S, J)."""
    decay = forgetting ** torch.arange(len(tau) - 1, -1, -1, dtype=torch.float64)
    total = decay @ tau
    if forgetting < 1:
        root = decay.sqrt()
        y, tau = y * root[:, None, None], tau * root[:, None]
    rows, torque = y.transpose(0, 1), tau.T[..., None]
    moment = (rows.mT @ torque)[..., 0]
    return Sums(rows.mT @ rows, moment, tau.square().sum(0), total, decay.sum())


def sums_of_draws(y: Tensor, torques: Tensor) -> list[Sums]:
    """Sums of each of R draws of torques, (R, S, J), over samples that share one regressor (S, J, P)."""
    rows, count = y.transpose(0, 1), torch.tensor(float(len(y)), dtype=torch.float64)
    information = rows.mT @ rows
    moments = rows.mT @ torques.permute(2, 1, 0)  # (J, P, R)
    each = zip(moments.unbind(-1), torques.square().sum(1), torques.sum(1))
    return [Sums(information, *one, count) for one in each]


def solve(information: Tensor, moment: Tensor, least: float) -> tuple[Tensor, Tensor]:
    """Solution (P,) and inverse (P, P) of information + least · I, also where the former is singular.

    Columns are scaled to unit information first: kilograms and kilogram square metres differ by orders of
    magnitude, which is not lack of excitation. Eigenvalues at the rounding of the sums are no information,
    so that such directions stay at the prior. The singular values of what is left, as rows, add the prior in
    the parameters' own units: no inverse of the ill-conditioned matrix is formed.
    """
    rows, right = rows_of(information, moment)
    u, s, vt = torch.linalg.svd(rows, full_matrices=True)
    unseen = 0, len(moment) - len(s)
    inverse = 1 / (pad(s.square(), unseen) + least)
    parameters = vt.T @ (inverse * pad(s * (u.T @ right), unseen))
    return parameters, (vt.T * inverse) @ vt


def rows_of(information: Tensor, moment: Tensor) -> tuple[Tensor, Tensor]:
    """Rows R (r, P) and right side z (r,) with Rᵀ R = information and Rᵀ z = moment, r its numerical rank."""
    scale = _scale(information)
    eigenvalues, vectors = torch.linalg.eigh(information / scale[:, None] / scale)
    kept = eigenvalues > _floor(eigenvalues)
    root, vectors = eigenvalues[kept].sqrt(), vectors[:, kept]
    return root[:, None] * vectors.T * scale, vectors.T @ (moment / scale) / root


def scaled_inverse(information: Tensor, rtol: float) -> Tensor:
    """Pseudo-inverse (P, P) of information with columns scaled to one length, in the parameters' units."""
    scale = _scale(information)
    inverse = torch.linalg.pinv(information / scale[:, None] / scale, rtol=rtol, hermitian=True)
    return inverse / scale[:, None] / scale


def condition(information: Tensor) -> float:
    """Condition number of a regressor with columns scaled to one length, from YᵀY (P, P).

    Infinite where the sums resolve no smallest direction, or a column is zero.
    """
    scale = _scale(information)
    eigenvalues = torch.linalg.eigvalsh(information / scale[:, None] / scale)
    if not len(eigenvalues) or eigenvalues[0] <= _floor(eigenvalues):
        return torch.inf
    return float((eigenvalues[-1] / eigenvalues[0]).sqrt())


def _scale(information: Tensor) -> Tensor:
    scale = information.diagonal().clamp_min(0).sqrt()
    return torch.where(scale > 0, scale, torch.ones_like(scale))


def _floor(eigenvalues: Tensor) -> Tensor:
    rounding = _ROUNDING * len(eigenvalues) * torch.finfo(eigenvalues.dtype).eps
    return rounding * eigenvalues[-1].clamp_min(0)
