"""What a trajectory or a set of them is worth: losses on the exact spectrum or diagonal of YᵀY."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from sidegan.base.typed import Count, Positive
from sidegan.design import physics
from sidegan.design.objective import HIGHEST, LOWEST, SHARPNESS
from sidegan.design.problem import Problem
from sidegan.errors import ConfigError

_FLOOR = 1e-12  # share of the largest eigenvalue, below which a direction counts as not excited


def log_condition(x: Tensor) -> Tensor:
    """Logarithm of the smooth largest over the smooth smallest of p values, ascending, (B, p) → (B,)."""
    logs = _logs(x)
    low = torch.logsumexp(-SHARPNESS * logs[:, :LOWEST], 1)
    return (low + torch.logsumexp(SHARPNESS * logs[:, -HIGHEST:], 1)) / SHARPNESS


def d_optimal(x: Tensor) -> Tensor:
    """Minus the mean log eigenvalue: the log volume of the parameters' confidence ellipsoid, (B,)."""
    return -_logs(x).mean(1)


def a_optimal(x: Tensor) -> Tensor:
    """Log of the mean inverse eigenvalue: the parameters' mean variance, (B,)."""
    logs = _logs(x)
    return torch.logsumexp(-logs, 1) - torch.log(torch.tensor(float(x.shape[1])))


def _logs(x: Tensor) -> Tensor:
    return torch.maximum(x, _FLOOR * x.amax(1, keepdim=True)).clamp_min(torch.finfo(x.dtype).tiny).log()


Objective = Callable[[Tensor], Tensor]

SPECTRAL: dict[str, Objective] = {
    "log_condition": log_condition,
    "d_optimal": d_optimal,
    "a_optimal": a_optimal,
}
OBJECTIVES = (*SPECTRAL, "diagonal_ratio")


@dataclass(frozen=True)
class Term:
    """One weighted term of the objective.

    Attributes:
        objective: ``log_condition``, ``diagonal_ratio``, ``d_optimal`` or ``a_optimal``.
        weight: factor of the term.
        together: number of generated trajectories whose information is taken together; 1: of each alone.
        noise: standard deviation of each joint's torque noise [N·m], by which the joints count; None: alike.

    Source: Pukelsheim 2006 for the optimal designs, the SIDE-GAN paper for the first two.
    """

    objective: Literal["log_condition", "diagonal_ratio", "d_optimal", "a_optimal"] = "log_condition"
    weight: Positive = 1.0
    together: Count = 1
    noise: list[Positive] | None = None

    def __post_init__(self) -> None:
        if self.objective not in OBJECTIVES:
            raise ConfigError(f"objective {self.objective!r} must be one of {', '.join(OBJECTIVES)}")
        if self.noise is not None and not all(deviation > 0 for deviation in self.noise):
            raise ConfigError(f"noise of an objective is {list(self.noise)}, expected positive deviations")
        if self.together < 1:
            raise ConfigError(f"an objective is of at least one trajectory, got together={self.together}")

    def __call__(self, problem: Problem, c: Tensor) -> Tensor:
        """Weighted mean over the sets of a batch (B, J, H, 2); 0-dimensional."""
        whole = c[: len(c) // self.together * self.together]
        information = physics.Information(problem, self.together, self.noise)
        if self.objective == "diagonal_ratio":
            return self.weight * log_condition(physics.diagonal(information, whole).sort(1).values).mean()
        if self.objective == "log_condition" and problem.body.parameters_count > LOWEST + HIGHEST:
            values = physics.ends(information, whole, LOWEST, HIGHEST)
        else:
            values = physics.spectrum(information, whole)
        return self.weight * SPECTRAL[self.objective](values).mean()
