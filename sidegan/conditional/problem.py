"""Trajectories of which each has its own home, period and limits, as one problem with exact gradients."""

from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor

from sidegan.conditional.condition import Condition
from sidegan.conditional.surroundings import Surroundings
from sidegan.design import physics
from sidegan.design.objective import directions_of, eigenpairs, smooth_condition
from sidegan.design.penalty import Penalty, excess
from sidegan.design.problem import HOPELESS, Problem
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Motion

_TINY = torch.finfo(torch.float64).tiny


@dataclass(frozen=True)
class ConditionedProblem(Problem):
    """A batch of trajectories under a batch of conditions.

    Coefficients are velocities: with another period the motion is that of the family's period, with
    positions from home in proportion to the period, accelerations against it and jerks against its square. So
    one basis serves all.
    The constraints are without torque limits: they differ between trajectories.
    """

    condition: Condition = field(kw_only=True)  # as many as there are coefficients in every call
    surroundings: Surroundings = field(kw_only=True)  # of the same arm
    torque: bool = field(kw_only=True)  # whether shares of the torque limits count

    @property
    def stretch(self) -> Tensor:
        """Each period over the family's, (B, 1, 1)."""
        return (self.condition.period / self.trajectory.period)[:, None, None]

    def motion(self, c: Tensor) -> Motion:
        """Joint motion at the problem's time points, (B, samples, J); the time is that of the family."""
        motion = super().motion(c)
        moved = motion.position - c.new_tensor(self.trajectory.home)
        position = self.condition.home[:, None] + moved * self.stretch
        return Motion(motion.time, position, motion.velocity, motion.acceleration / self.stretch)

    def jerk(self, c: Tensor) -> Tensor:
        """Jerk [rad/s³] at the problem's time points, (B, samples, J)."""
        return super().jerk(c) / self.stretch**2

    def violation(self, c: Tensor, penalty: Penalty) -> Tensor:
        """Squared relative violations of limits, distances and regions, mean over time, (B,).

        The same as the seeds' penalty, but for shares of the torque limits and regions of each trajectory.
        """
        motion, share = self.motion(c), penalty.weight / self.samples
        total = physics.violation(self, c, penalty)
        if self.torque:
            torque = self.body.torque(*motion[1:]).abs() / self.constraints.arm.torque_limit
            use = penalty.torque + torque / self.condition.torque[:, None, None] - 1
            total = total + share * excess(use)
        for distance in self.surroundings.clearances(motion.position, self.condition, penalty.reach).values():
            total = total + share * penalty.near(distance)
        return total


def variances(body: RigidBody, grams: Tensor) -> Tensor:
    """Variances of the base parameters, (B, p): the diagonal of each inverse of Gram matrices (B, p, p)."""
    return _variances(*_eigenpairs(body, grams))


def _variances(values: Tensor, vectors: Tensor) -> Tensor:
    return (vectors**2 / values[:, :, None]).sum(1)


def _eigenpairs(body: RigidBody, grams: Tensor) -> tuple[Tensor, Tensor]:
    """Eigenvalues λ, ascending, and rows v with G⁻¹ = Σ v vᵀ / λ, of Gram matrices G (B, p, p)."""
    values, vectors = eigenpairs(body, grams)
    return torch.maximum(values, (values[:, -1:] / HOPELESS).clamp_min(_TINY)), vectors


def information_losses(problem: Problem, c: Tensor, weights: Tensor) -> tuple[Tensor, Tensor]:
    """Smooth log condition number, and log of the weighted sum of the base parameters' variances, (B,) each.

    The variances are those of parameters identified from one sample of noise 1 per time point: the diagonal
    of (YᵀY / T)⁻¹; their weights, (B, p), are not negative. Where a row of them is zero, the second is zero.
    """
    return _InformationLosses.apply(*problem.motion(c)[1:], problem, c.detach(), weights)


class _InformationLosses(torch.autograd.Function):
    """For G = YᵀY / T, a function with slope S = Σ w v vᵀ in G has the energy Σ w |Y v|² / T as its gradient.

    The v are eigenvectors for the condition number, and columns of G⁻¹ for the variances.
    """

    @staticmethod
    def forward(
        ctx: Any, q: Tensor, dq: Tensor, ddq: Tensor, problem: Problem, c: Tensor, weights: Tensor
    ) -> tuple[Tensor, Tensor]:
        values, vectors = _eigenpairs(problem.body, problem.gram(c))
        ratio, slopes = smooth_condition(values)
        weighted = weights.amax(1) > 0
        total = torch.where(weighted, (weights * _variances(values, vectors)).sum(1), 1.0)
        ctx.problem, ctx.weighted = problem, weighted
        ctx.save_for_backward(q, dq, ddq, values, vectors, slopes, weights / total[:, None])
        return ratio, torch.log(total)

    @staticmethod
    def backward(ctx: Any, *upwards: Tensor) -> tuple[Tensor | None, ...]:
        *states, values, vectors, slopes, weights = ctx.saved_tensors
        gradients = _energies(ctx.problem, states, vectors, slopes * upwards[0][:, None])
        if ctx.weighted.any():
            rows = ctx.weighted.nonzero()[:, 0]
            count = int((weights[rows] > 0).sum(1).max())
            largest, order = weights[rows].topk(count, 1)
            inverse = (vectors[rows] / values[rows, :, None]).mT @ vectors[rows]
            columns = inverse.gather(1, order[:, :, None].expand(-1, -1, inverse.shape[2]))
            pushed = -largest * upwards[1][rows, None]
            more = _energies(ctx.problem, [x[rows] for x in states], columns, pushed)
            gradients = [x.index_add(0, rows, y) for x, y in zip(gradients, more)]
        return (*gradients, None, None, None)


def _energies(problem: Problem, states: list[Tensor], vectors: Tensor, weights: Tensor) -> list[Tensor]:
    """Gradients in the states, (B, T, J) each, of Σ weight |Y v|² / T over base vectors (B, K, p)."""
    directions = directions_of(problem.body, vectors, weights / problem.samples)
    return problem.body.penalised_slopes(states, *directions)[1]
