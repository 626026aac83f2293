"""Exact physics in place of the surrogates: loss terms and features with exact gradients."""

import torch
from torch import Tensor

from sidegan.design import physics
from sidegan.design.penalty import Penalty
from sidegan.design.problem import Problem
from sidegan.gan.surrogates import Standard
from sidegan.gan.terms import Batch, LossTerm
from sidegan.gan.variants import Exact

_CLEARANCE = 4.0  # times the reserve, in units of 0.25 m


class Violation(LossTerm[Batch]):
    """Mean squared relative violation of the constraints, by exact physics."""

    def __init__(self, weight: float, settings: Exact, problem: Problem) -> None:
        super().__init__(weight, settings.ease)
        self.problem, self.penalty = problem, penalty_of(settings.reserve)

    def forward(self, batch: Batch) -> Tensor:
        """Loss, 0-dimensional."""
        c = batch.coefficients
        return physics.violation(self.problem, c, self.penalty).to(c).mean()


class Objective(LossTerm[Batch]):
    """Sum of the exact objective's terms over a batch; the smaller, the better."""

    def __init__(self, weight: float, settings: Exact, problem: Problem) -> None:
        super().__init__(weight)
        self.problem, self.objectives = problem, tuple(settings.terms.values())

    def forward(self, batch: Batch) -> Tensor:
        """Loss, 0-dimensional."""
        c = batch.coefficients
        return torch.stack([objective(self.problem, c) for objective in self.objectives]).sum().to(c)


class ExactFeatures(Standard):
    """Standardised log spectrum, or log diagonal, (B, p): what a converter learns, computed.

    Args:
        problem: the trajectories.
        kind: ``spectrum`` or ``diagonal``.
        seeds: coefficients (N, J, H, 2) whose features have zero mean and unit spread.
    """

    def __init__(self, problem: Problem, kind: str, seeds: Tensor) -> None:
        self.information = physics.SetInformation(problem)
        self.of = physics.spectrum if kind == "spectrum" else physics.diagonal
        with torch.no_grad():
            features = self.of(self.information, seeds)
        super().__init__(features.shape[1])
        self.fit_standard(features)

    def forward(self, c: Tensor) -> Tensor:
        """Standardised log features, (B, p)."""
        return self.standardise(self.of(self.information, c))


def penalty_of(reserve: float) -> Penalty:
    """Penalty that keeps a share of the torque limits free, and four times that share of 0.25 m.

    Position and velocity limits hold by the generator's last layer.
    """
    return Penalty(1.0, limits=0.0, torque=reserve, distance=_CLEARANCE * reserve)
