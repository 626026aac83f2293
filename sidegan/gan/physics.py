"""Exact physics that gradients pass through: spectrum of the information, and violation of constraints.

The gradient of an eigenvalue of YᵀY needs the torques of one parameter vector, never a differentiated
regressor (``seeds.objective``); what follows from the eigenvalues is plain torch.
"""

from typing import Any

import torch
from torch import Tensor

from sidegan.dynamics import gram
from sidegan.errors import ShapeError
from sidegan.kernels import tensors as kernels
from sidegan.seeds import SeedProblem
from sidegan.seeds.objective import Penalty, pull_back


def spectrum(problem: SeedProblem, c: Tensor, together: int = 1) -> Tensor:
    """Eigenvalues of YᵀY / T in an orthonormal basis, ascending, (B / together, p) float64.

    Args:
        problem: the trajectories, and at how many time points Y is taken.
        c: coefficients [rad/s], (B, J, H, 2).
        together: so many trajectories in a row are one set, whose information is their sum.

    Raises:
        ShapeError: when the batch does not fall into such sets.
    """
    return _Spectrum.apply(c, problem, _sets(c, together))


def diagonal(problem: SeedProblem, c: Tensor, together: int = 1) -> Tensor:
    """Diagonal of YᵀY / T over the base columns, (B / together, p) float64; as ``spectrum`` otherwise."""
    return _Diagonal.apply(c, problem, _sets(c, together))


def violation(problem: SeedProblem, c: Tensor, penalty: Penalty) -> Tensor:
    """Penalty of violated constraints, (B,) float64: squared relative violations, mean over time."""
    return _Violation.apply(c, problem, penalty)


def _sets(c: Tensor, together: int) -> int:
    if together < 1 or len(c) % together:
        raise ShapeError(f"a batch of {len(c)} trajectories does not fall into sets of {together}")
    return together


def _grams(problem: SeedProblem, c: Tensor, together: int) -> Tensor:
    grams = gram(problem.body, problem.trajectory, c.double(), problem.samples)
    return grams.unflatten(0, (-1, together)).sum(1)


def _energy_gradient(
    problem: SeedProblem, c: Tensor, together: int, vectors: Tensor, slopes: Tensor
) -> Tensor:
    """Gradient in c of a function with these slopes, (S, p), in the energies of base vectors (S, p, p)."""
    base = problem.body.base
    used = (slopes != 0).any(0)  # most functions depend on a few eigenvalues
    if not used.any():
        return torch.zeros_like(c)
    full = slopes.new_zeros(len(slopes), int(used.sum()), 10 * problem.body.joints)
    full[:, :, base.columns] = vectors[:, used]
    members = [x.repeat_interleave(together, 0) for x in (full, slopes[:, used])]
    return pull_back(problem, c.double(), (members[0], members[1]), None)[1].to(c)


class _Spectrum(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, c: Tensor, problem: SeedProblem, together: int) -> Tensor:
        subspace = problem.body.base.subspace
        values, vectors = kernels.eigh(subspace.T @ _grams(problem, c, together) @ subspace)
        ctx.problem, ctx.together = problem, together
        ctx.save_for_backward(c, (subspace @ vectors).transpose(1, 2))
        return values

    @staticmethod
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor, None, None]:
        c, vectors = ctx.saved_tensors
        return _energy_gradient(ctx.problem, c, ctx.together, vectors, slopes[0]), None, None


class _Diagonal(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, c: Tensor, problem: SeedProblem, together: int) -> Tensor:
        ctx.problem, ctx.together = problem, together
        ctx.save_for_backward(c)
        return _grams(problem, c, together).diagonal(dim1=1, dim2=2).clone()

    @staticmethod
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor, None, None]:
        (c,) = ctx.saved_tensors
        count = slopes[0].shape[1]
        vectors = torch.eye(count, dtype=torch.float64).expand(len(slopes[0]), count, count)
        return _energy_gradient(ctx.problem, c, ctx.together, vectors, slopes[0]), None, None


class _Violation(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, c: Tensor, problem: SeedProblem, penalty: Penalty) -> Tensor:
        value, gradient = pull_back(problem, c.double(), None, penalty)
        ctx.save_for_backward(gradient.to(c))
        return value

    @staticmethod
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor, None, None]:
        (gradient,) = ctx.saved_tensors
        return slopes[0].to(gradient)[:, None, None, None] * gradient, None, None
