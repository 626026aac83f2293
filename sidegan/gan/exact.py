"""Exact physics in place of the surrogates: loss terms with exact gradients."""

import torch
from torch import Tensor

from sidegan.design import physics
from sidegan.design.penalty import Penalty
from sidegan.design.problem import Problem
from sidegan.gan.terms import Batch, Formula
from sidegan.gan.variants import Exact

_CLEARANCE = 4.0  # times the reserve, in units of 0.25 m


def violation(weight: float, settings: Exact, problem: Problem) -> Formula:
    """Mean squared relative violation of the constraints, by exact physics."""
    penalty = penalty_of(settings.reserve)

    def loss(batch: Batch) -> Tensor:
        c = batch.coefficients
        return physics.violation(problem, c, penalty).to(c).mean()

    return Formula(weight, loss, settings.ease)


def objective(weight: float, settings: Exact, problem: Problem) -> Formula:
    """Sum of the exact objective's terms over a batch; the smaller, the better."""

    def loss(batch: Batch) -> Tensor:
        c = batch.coefficients
        return torch.stack([term(problem, c) for term in settings.terms.values()]).sum().to(c)

    return Formula(weight, loss)


def penalty_of(reserve: float) -> Penalty:
    """Penalty that keeps a share of the torque limits free, and four times that share of 0.25 m.

    The limits on motion hold by the generator's last layer.
    """
    return Penalty(1.0, limits=0.0, torque=reserve, distance=_CLEARANCE * reserve)
