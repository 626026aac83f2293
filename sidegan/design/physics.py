"""Exact physics that gradients pass through: energies of the information, and violation of constraints.

The gradient of an energy |Y v|² needs the torques of one parameter vector, never a differentiated regressor
(``design.objective``); what follows from the energies is plain torch.
"""

from typing import Any

import torch
from torch import Tensor

from sidegan.design.objective import pull_back
from sidegan.design.penalty import Penalty
from sidegan.design.problem import Problem

_STATES_AT_ONCE = 4096  # whose regressor is kept: 10 MB at seven joints


def energies(problem: Problem, c: Tensor, directions: Tensor, weights: Tensor) -> Tensor:
    """Energies Σ (wⱼ yⱼ v)² / T, (B, K) float64, of directions v (p, K), of coefficients c [rad/s].

    Each joint's equations y count by its weight, (J,); these and the directions have no gradient.
    """
    return _Energies.apply(c, problem, directions, weights)


def violation(problem: Problem, c: Tensor, penalty: Penalty) -> Tensor:
    """Penalty of violated constraints, (B,) float64: squared relative violations, mean over time."""
    return _Violation.apply(c, problem, penalty)


class _Energies(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, c: Tensor, problem: Problem, directions: Tensor, weights: Tensor) -> Tensor:
        ctx.problem = problem
        ctx.save_for_backward(c, directions, weights)
        times, trajectory, values = problem.trajectory.grid(problem.samples), problem.trajectory, []
        for part in c.detach().to("cpu", torch.float64).split(max(1, _STATES_AT_ONCE // problem.samples)):
            y = problem.body.base_regressor(*trajectory.roll_out(part, times)[1:])
            values.append((weights[:, None] * (y @ directions)).square().sum((1, 2)) / problem.samples)
        return torch.cat(values).to(c.device)

    @staticmethod
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor, None, None, None]:
        c, directions, weights = ctx.saved_tensors
        vectors = directions.T.expand(len(c), -1, -1)
        _, gradient = pull_back(ctx.problem, c.detach().cpu(), vectors, slopes[0].cpu(), certainty=weights)
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
