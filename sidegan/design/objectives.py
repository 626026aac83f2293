"""Losses on the exact spectrum of YᵀY of a trajectory, or of a set of them."""

import math
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from sidegan.base.typed import Count, Positive
from sidegan.design.problem import Problem
from sidegan.kernels import HIGHEST, HOPELESS, LOWEST, SHARPNESS


def log_condition(x: Tensor) -> Tensor:
    """Logarithm of the smooth largest over the smooth smallest of p values, ascending, (B, p) → (B,).

    At most (log 3 + log 2) / 6 above the logarithm of the ratio; none but the first three and the last two
    values matter. What is under 10⁻¹² of the largest counts as that much, and has the slope of it. Where none
    is positive it is that of a hopeless ratio, without a slope.
    """
    positive = x[:, -1:] > 0
    floor = (x[:, -1:] / HOPELESS).clamp_min(torch.finfo(x.dtype).tiny)
    values = torch.where(positive, x + (torch.maximum(x, floor) - x).detach(), 1.0)
    low, high = values[:, :LOWEST].log(), values[:, -HIGHEST:].log()
    ends = torch.logsumexp(-SHARPNESS * low, 1) + torch.logsumexp(SHARPNESS * high, 1)
    return torch.where(positive[:, 0], ends / SHARPNESS, math.log(HOPELESS))


def d_optimal(x: Tensor) -> Tensor:
    """Minus the mean log eigenvalue: the log volume of the parameters' confidence ellipsoid, (B,).

    What is under 10⁻¹² of the largest counts as that much.
    """
    floor = (x.amax(1, keepdim=True) / HOPELESS).clamp_min(torch.finfo(x.dtype).tiny)
    return -torch.maximum(x, floor).log().mean(1)


OBJECTIVES = {"log_condition": log_condition, "d_optimal": d_optimal}


@dataclass(frozen=True)
class Term:
    """One weighted term of an exact objective.

    Source: Pukelsheim 2006 for the optimal design, the SIDE-GAN paper for the other.
    """

    objective: Literal["log_condition", "d_optimal"]
    weight: Positive = 1.0
    together: Count = 1  # generated trajectories whose information is taken together
    noise: list[Positive] | None = None  # of each joint's torque [N·m], by which the joints count

    def __call__(self, problem: Problem, c: Tensor) -> Tensor:
        """Weighted mean over the sets of a batch (B, J, H, 2); 0-dimensional."""
        from sidegan.design import physics  # compiled: imported when it is used

        whole = c[: len(c) // self.together * self.together]
        information = physics.SetInformation(problem, self.together, self.noise)
        eigenvalues = physics.spectrum(information, whole, ends=self.objective == "log_condition")
        return self.weight * OBJECTIVES[self.objective](eigenvalues).mean()
