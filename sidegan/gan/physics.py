"""Exact physics that gradients pass through: energies of the information, and violation of constraints.

The gradient of an energy |Y v|² needs the torques of one parameter vector, never a differentiated regressor
(``design.objective``); what follows from the energies is plain torch.
"""

from typing import Any

import numpy as np
import torch
from torch import Tensor

from sidegan.base.arrays import Array, split
from sidegan.design.objective import Penalty, pull_back
from sidegan.design.problem import Problem
from sidegan.gan.tensors import array, tensor

_STATES_AT_ONCE = 4096  # whose regressor is kept: 10 MB at seven joints


def energies(problem: Problem, c: Tensor, directions: Array, weights: Array) -> Tensor:
    """``energies_of``, through which gradients pass."""
    return _Energies.apply(c, problem, directions, weights)


def energies_of(problem: Problem, c: Array, directions: Array, weights: Array) -> Array:
    """Energies Σ (wⱼ yⱼ v)² / T, (B, K), of directions v (p, K), of coefficients c [rad/s].

    Each joint's equations y count by its weight, (J,).
    """
    times, trajectory, values = problem.trajectory.grid(problem.samples), problem.trajectory, []
    for part in split(c, max(1, _STATES_AT_ONCE // problem.samples)):
        y = problem.body.base_regressor(*trajectory.roll_out(part, times)[1:])
        values.append(np.square(weights[:, None] * (y @ directions)).sum((1, 2)) / problem.samples)
    return np.concatenate(values)


def violation(problem: Problem, c: Tensor, penalty: Penalty) -> Tensor:
    """Penalty of violated constraints, (B,) float64: squared relative violations, mean over time."""
    return _Violation.apply(c, problem, penalty)


class _Energies(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, c: Tensor, problem: Problem, directions: Array, weights: Array) -> Tensor:
        ctx.save_for_backward(c)
        ctx.constants = problem, directions, weights
        return tensor(energies_of(problem, array(c), directions, weights))

    @staticmethod
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor, None, None, None]:
        (c,), (problem, directions, weights) = ctx.saved_tensors, ctx.constants
        vectors = np.repeat(directions.T[None], len(c), 0)
        _, gradient = pull_back(problem, array(c), vectors, array(slopes[0]), certainty=weights)
        return tensor(gradient).to(c), None, None, None


class _Violation(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, c: Tensor, problem: Problem, penalty: Penalty) -> Tensor:
        none = np.zeros((len(c), 0, problem.body.parameters_count))
        value, gradient = pull_back(problem, array(c), none, none[:, :, 0], penalty)
        ctx.save_for_backward(tensor(gradient).to(c))
        return tensor(value)

    @staticmethod
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor, None, None]:
        (gradient,) = ctx.saved_tensors
        return slopes[0].to(gradient)[:, None, None, None] * gradient, None, None
