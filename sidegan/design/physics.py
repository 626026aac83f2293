"""Exact physics that gradients pass through: spectrum of the information, and violation of constraints.

The gradient of an eigenvalue of YᵀY needs the torques of one parameter vector, never a differentiated
regressor (``design.objective``); what follows from the eigenvalues is plain torch.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from sidegan.design.information import weighted_gram
from sidegan.design.objective import directions_of, eigenpairs, pull_back
from sidegan.design.penalty import Penalty
from sidegan.design.problem import Problem
from sidegan.errors import ShapeError


@dataclass(frozen=True)
class SetInformation:
    """Information of sets of trajectories: of how many together, and in which units of torque."""

    problem: Problem
    together: int = 1  # so many trajectories in a row are one set, whose information is their sum
    noise: Sequence[float] | None = None  # deviation of joint torques [N·m], by which rows of Y are divided

    def __post_init__(self) -> None:
        joints = self.problem.body.joints
        if self.noise is not None and not (len(self.noise) == joints and min(self.noise) > 0):
            raise ShapeError(f"noise is {list(self.noise)}, expected {joints} positive deviations")

    def grams(self, c: Tensor) -> Tensor:
        """Gram matrices YᵀY / T over the base columns, (B / together, p, p), without gradient."""
        if self.together < 1 or len(c) % self.together:
            raise ShapeError(f"a batch of {len(c)} trajectories does not fall into sets of {self.together}")
        problem, c = self.problem, c.detach().to("cpu", torch.float64)
        if self.noise is None:
            grams = problem.gram(c)
        else:
            grams = weighted_gram(problem.body, problem.motion(c), 1 / c.new_tensor(self.noise))
        return grams.unflatten(0, (-1, self.together)).sum(1)

    def slopes(self, c: Tensor, vectors: Tensor, weights: Tensor) -> Tensor:
        """Gradient in c, (B, J, H, 2), of Σ weight · |Y v|² / T over the vectors, (S, K, p), of each set."""
        problem = self.problem
        v, w = (x.repeat_interleave(self.together, 0) for x in directions_of(problem.body, vectors, weights))
        if not w.shape[1]:
            return torch.zeros_like(c)
        x = c.detach().to("cpu", torch.float64)
        if self.noise is None:
            return pull_back(problem, x, (v, w), None)[1].to(c)
        with torch.enable_grad():
            x.requires_grad_(True)
            torque = problem.body.torques_of(*problem.motion(x)[1:], v)
            energy = ((torque / x.new_tensor(self.noise)) ** 2).sum((2, 3)) / problem.samples
            (gradient,) = torch.autograd.grad((w * energy).sum(), x)
        return gradient.to(c)


def spectrum(information: SetInformation, c: Tensor, ends: bool = False) -> Tensor:
    """Eigenvalues of YᵀY / T in an orthonormal basis, ascending, (B / together, p), of coefficients c.

    At the ends, only those that a smooth condition number needs, in much less time.
    """
    pairs = eigenpairs(information.problem.body, information.grams(c), ends)
    return _Quadratic.apply(c, information, *pairs)


def diagonal(information: SetInformation, c: Tensor) -> Tensor:
    """Diagonal of YᵀY / T over the base columns, (B / together, p)."""
    values = information.grams(c).diagonal(dim1=1, dim2=2)
    return _Quadratic.apply(c, information, values, torch.eye(values.shape[1]).expand(len(values), -1, -1))


def violation(problem: Problem, c: Tensor, penalty: Penalty) -> Tensor:
    """Penalty of violated constraints, (B,) float64: squared relative violations, mean over time."""
    return _Violation.apply(c, problem, penalty)


class _Quadratic(torch.autograd.Function):
    """Values vᵀ YᵀY v / T, (S, K), with the gradient of as many vectors that stay as they are, (S, K, p)."""

    @staticmethod
    def forward(ctx: Any, c: Tensor, information: SetInformation, values: Tensor, vectors: Tensor) -> Tensor:
        ctx.information = information
        ctx.save_for_backward(c, vectors)
        return values.clone()

    @staticmethod
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor, None, None, None]:
        c, vectors = ctx.saved_tensors
        return ctx.information.slopes(c, vectors, slopes[0]), None, None, None


class _Violation(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, c: Tensor, problem: Problem, penalty: Penalty) -> Tensor:
        value, gradient = pull_back(problem, c.to("cpu", torch.float64), None, penalty)
        ctx.save_for_backward(gradient.to(c))
        return value

    @staticmethod
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor, None, None]:
        (gradient,) = ctx.saved_tensors
        return slopes[0].to(gradient)[:, None, None, None] * gradient, None, None
