"""Exact physics behind the surrogates' interface, for variants that train without surrogates."""

import torch
from torch import Tensor

from sidegan.design import physics
from sidegan.design.penalty import Penalty
from sidegan.design.problem import Problem
from sidegan.gan.surrogates import Standard
from sidegan.gan.variants import Exact
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints

_CLEARANCE = 4.0  # times the reserve, in units of 0.25 m


class ExactPhysics:
    """Violation and fitness of generated coefficients (B, J, H, 2), with exact gradients.

    Args:
        constraints: the arm in its workspace.
        trajectory: the family of trajectories.
        settings: objectives, time points and reserve.
    """

    def __init__(self, constraints: Constraints, trajectory: Trajectory, settings: Exact) -> None:
        self.problem = Problem(constraints, trajectory, settings.samples)
        self.terms, self.ease = settings.terms, settings.ease
        self.penalty = Penalty(
            1.0, limits=0.0, torque=settings.reserve, distance=_CLEARANCE * settings.reserve
        )

    def violation(self, c: Tensor) -> Tensor:
        """Squared relative violations of the constraints, mean over time, (B,)."""
        return physics.violation(self.problem, c, self.penalty).to(c)

    def fitness(self, c: Tensor) -> Tensor:
        """Sum of the objective's terms over a batch; the smaller, the better."""
        return torch.stack([term(self.problem, c) for term in self.terms]).sum().to(c)


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
