"""Value and exact gradient of the penalised condition number, for a whole batch at once.

For an eigenpair (λ, v) of YᵀY, dλ = 2 (Y v)ᵀ d(Y v), and Y v is the torque of the robot whose
inertial parameters are v: the gradient of any function of the spectrum costs a few inverse dynamics,
never a differentiated regressor.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from sidegan.dynamics import gram
from sidegan.seeds.problem import HOPELESS, SeedProblem

_DISTANCE = 0.25  # [m] clearance that counts like a whole joint range in the penalty


@dataclass(frozen=True)
class Penalty:
    """How strongly violations count, and the share of each limit that is kept in reserve."""

    weight: float = 300.0
    limits: float = 0.01
    torque: float = 0.03
    distance: float = 0.08


def value_and_gradient(problem: SeedProblem, c: Tensor, penalty: Penalty) -> tuple[Tensor, Tensor]:
    """Log fitness plus penalty, (B,), and its gradient, (B, J, H, 2), at coefficients c."""
    c = c.detach().requires_grad_(True)
    motion = problem.motion(c)
    vectors, weights, value = _directions(problem, c.detach())
    torque_rows = problem.constraints.torque
    if torque_rows:
        own = problem.constraints.arm.inertial_parameters.reshape(1, 1, -1).expand(len(c), 1, -1)
        vectors = torch.cat([vectors, own], 1)
    torques = problem.body.torques_of(*motion[1:], vectors)
    count = weights.shape[1]
    energy = (torques[:, :count] ** 2).sum(3).mean(2)
    # Only the gradient of this sum is used; its value is that of the fitness.
    surrogate = (weights * energy).sum(1)
    own_torque = torques[:, count] if torque_rows else None
    violation = _violation(problem, motion.position, motion.velocity, own_torque, penalty)
    total = penalty.weight * violation
    (gradient,) = torch.autograd.grad((surrogate + total).sum(), c)
    return value + total.detach(), gradient


@torch.no_grad()
def _directions(problem: SeedProblem, c: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Parameter vectors (B, K, 10 J), weights ∂f/∂λ (B, K), and the log fitness f (B,)."""
    body = problem.body
    grams = gram(body, problem.trajectory, c, problem.samples)
    base = body.base
    if problem.diagonal:
        diagonal = grams.diagonal(dim1=1, dim2=2)
        (low, low_at), (high, high_at) = diagonal.min(1), diagonal.max(1)
        picked = torch.stack([low_at, high_at], 1)
        chosen = torch.nn.functional.one_hot(picked, len(base.columns)).to(c)
    else:
        eigenvalues, eigenvectors = torch.linalg.eigh(base.subspace.T @ grams @ base.subspace)
        low, high = eigenvalues[:, 0], eigenvalues[:, -1]
        chosen = (base.subspace @ eigenvectors[:, :, [0, -1]]).transpose(1, 2)
    low = torch.maximum(low, high / HOPELESS)
    vectors = c.new_zeros(len(c), 2, 10 * body.joints)
    vectors[:, :, base.columns] = chosen
    return vectors, torch.stack([-1 / low, 1 / high], 1), torch.log(high / low)


def _violation(
    problem: SeedProblem, q: Tensor, dq: Tensor, torque: Tensor | None, penalty: Penalty
) -> Tensor:
    """Sum over constraints of the mean squared relative violation over time, (B,)."""
    arm = problem.constraints.arm
    room = (arm.position_upper - arm.position_lower) / 2
    position = torch.minimum(q - arm.position_lower, arm.position_upper - q) / room
    parts = [penalty.limits - position, penalty.limits + dq.abs() / arm.velocity_limit - 1]
    if torque is not None:
        parts.append(penalty.torque + torque.abs() / arm.torque_limit - 1)
    shape = q.shape[:2]
    for distance in problem.constraints.clearances(q.reshape(-1, q.shape[-1])).values():
        parts.append(penalty.distance - distance.reshape(*shape, -1) / _DISTANCE)
    return torch.stack([(part.clamp_min(0) ** 2).sum(2).mean(1) for part in parts]).sum(0)
