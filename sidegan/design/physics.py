"""Exact physics that gradients pass through: spectrum of the information, and violation of constraints.

The gradient of an eigenvalue of YᵀY needs the torques of one parameter vector, never a differentiated
regressor (``seeds.objective``); what follows from the eigenvalues is plain torch.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from sidegan.design.objective import Penalty, pull_back
from sidegan.design.problem import Problem
from sidegan.errors import ShapeError
from sidegan.motion.compiled import tensors as kernels
from sidegan.motion.dynamics import gram


@dataclass(frozen=True)
class Information:
    """Which YᵀY: at how many time points, of how many trajectories together, in which units of torque.

    Args:
        problem: the trajectories and their time points.
        together: so many trajectories in a row are one set, whose information is their sum.
        noise: standard deviation of each joint's torque noise [N·m], J of them, by which its rows of Y are
            divided; None: rows as they are.

    Raises:
        ShapeError: when the noise is not a positive number per joint.
    """

    problem: Problem
    together: int = 1
    noise: Sequence[float] | None = None

    def __post_init__(self) -> None:
        joints = self.problem.body.joints
        if self.noise is not None and not (len(self.noise) == joints and min(self.noise) > 0):
            raise ShapeError(f"noise is {list(self.noise)}, expected {joints} positive deviations")

    def grams(self, c: Tensor) -> Tensor:
        """Gram matrices YᵀY / T over the base columns, (B / together, p, p), without gradient.

        Raises:
            ShapeError: when the batch does not fall into such sets.
        """
        if self.together < 1 or len(c) % self.together:
            raise ShapeError(f"a batch of {len(c)} trajectories does not fall into sets of {self.together}")
        problem, c = self.problem, c.detach().double()
        if self.noise is None:
            grams = gram(problem.body, problem.trajectory, c, problem.samples)
        else:
            y = problem.body.base_regressor(*problem.motion(c)[1:])
            y = (y / c.new_tensor(self.noise)[:, None]).flatten(1, 2)
            grams = y.transpose(1, 2) @ y / problem.samples
        return grams.unflatten(0, (-1, self.together)).sum(1)

    def slopes(self, c: Tensor, vectors: Tensor, weights: Tensor) -> Tensor:
        """Gradient in c, (B, J, H, 2), of Σ weight · |Y v|² / T over the vectors, (S, K, p), of each set."""
        base = self.problem.body.base
        used = (weights != 0).any(0)  # most functions depend on a few eigenvalues
        if not used.any():
            return torch.zeros_like(c)
        full = weights.new_zeros(len(weights), int(used.sum()), 10 * self.problem.body.joints)
        full[:, :, base.columns] = vectors[:, used]
        v, w = (x.repeat_interleave(self.together, 0) for x in (full, weights[:, used]))
        if self.noise is None:
            return pull_back(self.problem, c.double(), (v, w), None)[1].to(c)
        with torch.enable_grad():
            x = c.detach().double().requires_grad_(True)
            torque = self.problem.body.torques_of(*self.problem.motion(x)[1:], v)
            energy = ((torque / x.new_tensor(self.noise)) ** 2).sum((2, 3)) / self.problem.samples
            (gradient,) = torch.autograd.grad((w * energy).sum(), x)
        return gradient.to(c)


def spectrum(information: Information, c: Tensor) -> Tensor:
    """Eigenvalues of YᵀY / T in an orthonormal basis, ascending, (B / together, p) float64.

    Args:
        information: which YᵀY.
        c: coefficients [rad/s], (B, J, H, 2).

    Raises:
        ShapeError: when the batch does not fall into sets.
    """
    return _Spectrum.apply(c, information, None)


def ends(information: Information, c: Tensor, lowest: int, highest: int) -> Tensor:
    """So many of the smallest and of the largest eigenvalues, ascending, (B / together, lowest + highest).

    Takes a fraction of the time of the whole ``spectrum``.
    """
    return _Spectrum.apply(c, information, (lowest, highest))


def diagonal(information: Information, c: Tensor) -> Tensor:
    """Diagonal of YᵀY / T over the base columns, (B / together, p) float64; as ``spectrum`` otherwise."""
    return _Diagonal.apply(c, information)


def violation(problem: Problem, c: Tensor, penalty: Penalty) -> Tensor:
    """Penalty of violated constraints, (B,) float64: squared relative violations, mean over time."""
    return _Violation.apply(c, problem, penalty)


def _ends(values: Tensor, vectors: Tensor, lowest: int, highest: int) -> tuple[Tensor, Tensor]:
    """The same pairs, or those at the ends where all of them came."""
    count = values.shape[1]
    kept = [*range(lowest), *range(count - highest, count)]
    return values[:, kept], vectors[:, :, kept]


class _Spectrum(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, c: Tensor, information: Information, wanted: tuple[int, int] | None) -> Tensor:
        subspace = information.problem.body.base.subspace
        grams = subspace.T @ information.grams(c) @ subspace
        if wanted is None:
            values, vectors = kernels.eigh(grams)
        else:
            values, vectors = _ends(*kernels.extremes(grams, *wanted), *wanted)
        ctx.information = information
        ctx.save_for_backward(c, (subspace @ vectors).transpose(1, 2))
        return values

    @staticmethod
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor, None, None]:
        c, vectors = ctx.saved_tensors
        return ctx.information.slopes(c, vectors, slopes[0]), None, None


class _Diagonal(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, c: Tensor, information: Information) -> Tensor:
        ctx.information = information
        ctx.save_for_backward(c)
        return information.grams(c).diagonal(dim1=1, dim2=2).clone()

    @staticmethod
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor, None]:
        (c,) = ctx.saved_tensors
        count = slopes[0].shape[1]
        vectors = torch.eye(count, dtype=torch.float64).expand(len(slopes[0]), count, count)
        return ctx.information.slopes(c, vectors, slopes[0]), None


class _Violation(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, c: Tensor, problem: Problem, penalty: Penalty) -> Tensor:
        value, gradient = pull_back(problem, c.double(), None, penalty)
        ctx.save_for_backward(gradient.to(c))
        return value

    @staticmethod
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor, None, None]:
        (gradient,) = ctx.saved_tensors
        return slopes[0].to(gradient)[:, None, None, None] * gradient, None, None
