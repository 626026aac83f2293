"""Least squares on sums: sufficient statistics of the samples, in bounded memory."""

import math
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array

_CONSTANT = 1e-13  # share of the mean square: a smaller variance is rounding
_SINGULAR = 1e-10  # a smaller share of the largest eigenvalue is rounding of an inverse
_ROUNDING = 16  # an eigenvalue below 16 p ε of the largest is rounding of the sums, not information


class Sums(NamedTuple):
    """Sums over samples of τ = Y θ, kept per joint so that weights can be chosen afterwards."""

    information: Array  # Σ Y_jᵀ Y_j, (J, P, P)
    moment: Array  # Σ Y_jᵀ τ_j, (J, P)
    energy: Array  # Σ τ_j², (J,)
    total: Array  # Σ τ_j, (J,)
    weight: Array  # number of samples, ()

    def plus(self, other: "Sums") -> "Sums":
        """Sums over both sets of samples."""
        return Sums(*(a + b for a, b in zip(self, other)))

    def first(self, count: int) -> "Sums":
        """Sums in which all but the first columns are zero."""
        kept = np.arange(self.moment.shape[1]) < count
        information = self.information * (kept[:, None] & kept)
        return self._replace(information=information, moment=self.moment * kept)

    def weighted(self, weights: Array) -> tuple[Array, Array]:
        """Information (P, P) and moment (P,) of all joints, with joint j's equations times ``weights[j]``."""
        squares = np.square(weights)
        return np.tensordot(squares, self.information, 1), squares @ self.moment

    @property
    def variance(self) -> Array:
        """Variance of each joint's torque, (J,); zero where it is only rounding of the sums."""
        mean, square = self.total / self.weight, self.energy / self.weight
        variance = square - np.square(mean)
        return np.where(variance > _CONSTANT * square, variance, 0.0)

    def squares(self, parameters: Array) -> Array:
        """Sum of squared residuals of each joint, (J,); exact to about 1e-13 of the torque's squares."""
        squares = self.energy - 2 * self.moment @ parameters + self.information @ parameters @ parameters
        return np.maximum(squares, 0)

    def nmse(self, parameters: Array) -> Array:
        """Mean squared residual over the torque's variance, (J,); infinite where the torque is constant."""
        squares = self.squares(parameters) / self.weight
        variance = self.variance
        return np.divide(squares, variance, out=np.full_like(squares, np.inf), where=variance > 0)


def no_sums(joints: int, parameters: int) -> Sums:
    """Sums over no samples."""
    shapes = (joints, parameters, parameters), (joints, parameters), (joints,), (joints,), ()
    return Sums(*(np.zeros(shape) for shape in shapes))


def sums_of(y: Array, tau: Array) -> Sums:
    """Sums over samples of a regressor (S, J, P) and torque (S, J)."""
    return sums_of_draws(y, tau[None])[0]


def sums_of_draws(y: Array, torques: Array) -> list[Sums]:
    """Sums for each of R draws of torques, (R, S, J), with a common regressor (S, J, P)."""
    rows = y.transpose(1, 2, 0)
    count = np.array(float(len(y)))
    information = rows @ rows.mT
    moments = rows @ torques.transpose(2, 1, 0)  # (J, P, R)
    each = zip(np.moveaxis(moments, -1, 0), np.square(torques).sum(1), torques.sum(1))
    return [Sums(information, *draw, count) for draw in each]


def solve(information: Array, moment: Array, least: float) -> tuple[Array, Array]:
    """Solution (P,) and inverse (P, P) of information + least · I, even if the information is singular.

    Columns are first scaled to unit information, since masses and inertias differ by orders of magnitude
    even when well excited. Directions whose eigenvalue is rounding of the sums stay at the prior. The prior
    is added, in the parameters' own units, to the singular values of the remaining rows: the ill-conditioned
    matrix is never inverted.
    """
    rows, right = rows_of(information, moment)
    u, s, vt = np.linalg.svd(rows, full_matrices=True)
    unseen = 0, len(moment) - len(s)
    inverse = 1 / (np.pad(np.square(s), unseen) + least)
    parameters = vt.T @ (inverse * np.pad(s * (u.T @ right), unseen))
    return parameters, (vt.T * inverse) @ vt


def rows_of(information: Array, moment: Array) -> tuple[Array, Array]:
    """Rows R (r, P) and right-hand side z (r,), r the numerical rank: Rᵀ R = information, Rᵀ z = moment."""
    scaled, scale = _scaled(information)
    eigenvalues, vectors = np.linalg.eigh(scaled)
    kept = eigenvalues > _floor(eigenvalues)
    root = np.sqrt(eigenvalues[kept])
    vectors = vectors[:, kept]
    return root[:, None] * vectors.T * scale, vectors.T @ (moment / scale) / root


def scaled_inverse(information: Array, rtol: float = _SINGULAR) -> Array:
    """Pseudo-inverse (P, P) of information, computed with columns scaled to unit length."""
    scaled, scale = _scaled(information)
    inverse = np.linalg.pinv(scaled, rtol=rtol, hermitian=True)
    return inverse / scale[:, None] / scale


def condition(information: Array) -> float:
    """Condition number of a regressor with columns scaled to unit length, from YᵀY (P, P).

    Infinite if the smallest eigenvalue is rounding, or a column is zero.
    """
    eigenvalues = np.linalg.eigvalsh(_scaled(information)[0])
    if not len(eigenvalues) or eigenvalues[0] <= _floor(eigenvalues):
        return math.inf
    return float(np.sqrt(eigenvalues[-1] / eigenvalues[0]))


def _scaled(information: Array) -> tuple[Array, Array]:
    """Information with unit diagonal, (P, P), and the scale of each column, (P,)."""
    scale = np.sqrt(np.maximum(information.diagonal(), 0))
    scale = np.where(scale > 0, scale, 1.0)
    return information / scale[:, None] / scale, scale


def _floor(eigenvalues: Array) -> float:
    return _ROUNDING * len(eigenvalues) * float(np.finfo(float).eps * max(eigenvalues[-1], 0))
