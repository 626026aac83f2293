"""Exact physics that gradients pass through: spectrum of the information, and violation of constraints.

The gradient of an eigenvalue of YᵀY needs the torques of one parameter vector, never a differentiated
regressor (``design.objective``); what follows from the eigenvalues is plain torch.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from sidegan.design.information import certainty_of, weighted_gram
from sidegan.design.objective import pull_back
from sidegan.design.penalty import Penalty
from sidegan.design.problem import Problem
from sidegan.errors import ShapeError
from sidegan.kernels import HIGHEST, LOWEST
from sidegan.motion.operations import extremes
from sidegan.motion.threads import eigh


@dataclass(frozen=True)
class SetInformation:
    """Information of sets of trajectories: of how many together, and in which units of torque."""

    problem: Problem
    together: int = 1  # so many trajectories in a row are one set, whose information is their sum
    noise: Sequence[float] | None = None  # deviation of joint torques [N·m], by which rows of Y are divided

    @property
    def certainty(self) -> Tensor | None:
        """Factors of each joint's rows of Y, (J,)."""
        return None if self.noise is None else certainty_of(self.noise, self.problem.body.joints)

    def grams(self, c: Tensor) -> Tensor:
        """Gram matrices YᵀY / T over the base columns, (B / together, p, p), without gradient."""
        if self.together < 1 or len(c) % self.together:
            raise ShapeError(f"a batch of {len(c)} trajectories does not fall into sets of {self.together}")
        problem, c, certainty = self.problem, c.detach().to("cpu", torch.float64), self.certainty
        if certainty is None:
            grams = problem.gram(c)
        else:
            grams = weighted_gram(problem.body, problem.trajectory, c, problem.samples, certainty)
        return grams.unflatten(0, (-1, self.together)).sum(1)


def spectrum(information: SetInformation, c: Tensor, ends: bool = False) -> Tensor:
    """Eigenvalues of YᵀY / T in an orthonormal basis, ascending, (B / together, p), of coefficients c.

    At the ends, only those that a smooth condition number looks at, in a fraction of the time.
    """
    subspace = information.problem.body.base.subspace
    inner = subspace.T @ information.grams(c) @ subspace
    values, vectors = extremes(inner, LOWEST, HIGHEST) if ends else eigh(inner)
    return _Quadratic.apply(c, information, values, (subspace @ vectors).mT)


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
        one = ctx.information
        vectors, weights = (x.cpu().repeat_interleave(one.together, 0) for x in (vectors, slopes[0]))
        _, gradient = pull_back(one.problem, c.detach().cpu(), vectors, weights, certainty=one.certainty)
        return gradient.to(c), None, None, None


class _Violation(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, c: Tensor, problem: Problem, penalty: Penalty) -> Tensor:
        none = torch.zeros(len(c), 0, problem.body.parameters_count)
        value, gradient = pull_back(problem, c.detach().cpu(), none, none[:, :, 0], penalty)
        ctx.save_for_backward(gradient.to(c))
        return value

    @staticmethod
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor, None, None]:
        (gradient,) = ctx.saved_tensors
        return slopes[0].to(gradient)[:, None, None, None] * gradient, None, None
