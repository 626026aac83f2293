"""Losses on the exact spectrum or diagonal of YᵀY of a trajectory, or of a set of them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import torch
from torch import Tensor

from sidegan.base.typed import Count, Positive
from sidegan.design.problem import Problem
from sidegan.kernels import HOPELESS


def log_condition(x: Tensor) -> Tensor:
    """Logarithm of the smooth largest over the smooth smallest of p values, ascending, (B, p) → (B,)."""
    return _LogCondition.apply(x)


class _LogCondition(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, x: Tensor) -> Tensor:
        from sidegan.design.physics import smooth_condition  # compiled: imported when it is used

        value, slopes = smooth_condition(x)
        ctx.save_for_backward(slopes)
        return value

    @staticmethod
    def backward(ctx: Any, *upwards: Tensor) -> Tensor:
        return upwards[0][:, None] * ctx.saved_tensors[0]


def d_optimal(x: Tensor) -> Tensor:
    """Minus the mean log eigenvalue: the log volume of the parameters' confidence ellipsoid, (B,)."""
    return -_logs(x).mean(1)


def a_optimal(x: Tensor) -> Tensor:
    """Log of the mean inverse eigenvalue: the parameters' mean variance, (B,)."""
    logs = _logs(x)
    return torch.logsumexp(-logs, 1) - torch.log(torch.tensor(float(x.shape[1])))


def _logs(x: Tensor) -> Tensor:
    """Logarithms; what is under 10⁻¹² of the largest counts as that much."""
    return torch.maximum(x, x.amax(1, keepdim=True) / HOPELESS).clamp_min(torch.finfo(x.dtype).tiny).log()


SPECTRAL: dict[str, Callable[[Tensor], Tensor]] = {
    "log_condition": log_condition,
    "d_optimal": d_optimal,
    "a_optimal": a_optimal,
}


@dataclass(frozen=True)
class Term:
    """One weighted term of an exact objective.

    Source: Pukelsheim 2006 for the optimal designs, the SIDE-GAN paper for the other two.
    """

    objective: Literal["log_condition", "diagonal_ratio", "d_optimal", "a_optimal"]
    weight: Positive = 1.0
    together: Count = 1  # generated trajectories whose information is taken together
    noise: list[Positive] | None = None  # of each joint's torque [N·m], by which the joints count

    def __call__(self, problem: Problem, c: Tensor) -> Tensor:
        """Weighted mean over the sets of a batch (B, J, H, 2); 0-dimensional."""
        from sidegan.design import physics  # compiled: imported when it is used

        whole = c[: len(c) // self.together * self.together]
        information = physics.SetInformation(problem, self.together, self.noise)
        if self.objective == "diagonal_ratio":
            values = log_condition(physics.diagonal(information, whole).sort(1).values)
        else:
            eigenvalues = physics.spectrum(information, whole, ends=self.objective == "log_condition")
            values = SPECTRAL[self.objective](eigenvalues)
        return self.weight * values.mean()
