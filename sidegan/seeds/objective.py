"""Value and exact gradient of the penalised condition number, for a whole batch at once.

For an eigenpair (λ, v) of YᵀY, dλ = 2 (Y v)ᵀ d(Y v), and Y v is the torque of the robot whose
inertial parameters are v: the gradient of any function of a few eigenvalues costs a few inverse
dynamics, never a differentiated regressor.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from sidegan.seeds.problem import HOPELESS, SeedProblem
from sidegan.trajectory import Motion

_DISTANCE = 0.25  # [m] clearance that counts like a whole joint range in the penalty
_STATES_AT_ONCE = 8_192  # bounds the memory of a gradient to about 300 MB for seven joints
# The smallest eigenvalue changes places with its neighbours all the time; a smooth minimum over a few
# spares the optimiser the kinks: 20 % lower condition numbers after as many steps.
_LOWEST, _HIGHEST, _SHARPNESS = 3, 2, 6.0


@dataclass(frozen=True)
class Penalty:
    """How strongly violations count, and the share of each limit that is kept in reserve."""

    weight: float
    limits: float = 0.05
    torque: float = 0.05
    distance: float = 0.1


def value_and_gradient(problem: SeedProblem, c: Tensor, penalty: Penalty | None) -> tuple[Tensor, Tensor]:
    """Smooth log fitness plus penalty, (B,), and its gradient, (B, J, H, 2), at coefficients c.

    Works through the states in pieces, then carries the gradient from the motion back to the
    coefficients, in which it is linear: memory does not grow with the number of samples.
    """
    c = c.detach().requires_grad_(True)
    motion = problem.motion(c)
    vectors, weights, value = _directions(problem, c.detach())
    slopes = [torch.zeros_like(x) for x in motion[1:]]
    violation = torch.zeros_like(value)
    batch, times = max(1, _STATES_AT_ONCE // problem.samples), min(problem.samples, _STATES_AT_ONCE)
    for rows in torch.arange(len(c)).split(batch):
        for columns in torch.arange(problem.samples).split(times):
            piece = (slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1))
            states = Motion(
                motion.time[piece[1]], *(x[piece].detach().requires_grad_(True) for x in motion[1:])
            )
            surrogate, excess = _terms(problem, states, vectors[piece[0]], weights[piece[0]], penalty)
            for slope, found in zip(slopes, torch.autograd.grad((surrogate + excess).sum(), states[1:])):
                slope[piece] = found / problem.samples
            violation[piece[0]] += excess.detach() / problem.samples
    (gradient,) = torch.autograd.grad(motion[1:], c, slopes)
    return value + violation, gradient


def smooth_fitness(problem: SeedProblem, c: Tensor) -> Tensor:
    """Smooth log fitness, (B,): at most (log 3 + log 2) / 6 above the logarithm of the fitness."""
    return _directions(problem, c.detach())[2]


@torch.no_grad()
def _directions(problem: SeedProblem, c: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Parameter vectors (B, K, 10 J), weights ∂f/∂λ (B, K), and the smooth log fitness f (B,)."""
    base = problem.body.base
    grams = problem.gram(c)
    if problem.diagonal:
        values, order = grams.diagonal(dim1=1, dim2=2).sort(1)
        vectors = torch.nn.functional.one_hot(order, len(base.columns)).to(c)
    else:
        values, eigenvectors = torch.linalg.eigh(base.subspace.T @ grams @ base.subspace)
        vectors = (base.subspace @ eigenvectors).transpose(1, 2)
    values = torch.maximum(values, values[:, -1:] / HOPELESS)
    low, high = values[:, :_LOWEST], values[:, -_HIGHEST:]
    softened = [-_SHARPNESS * torch.log(low), _SHARPNESS * torch.log(high)]
    weights = torch.cat([-torch.softmax(softened[0], 1) / low, torch.softmax(softened[1], 1) / high], 1)
    chosen = c.new_zeros(len(c), weights.shape[1], 10 * problem.body.joints)
    chosen[:, :, base.columns] = torch.cat([vectors[:, :_LOWEST], vectors[:, -_HIGHEST:]], 1)
    value = torch.stack([torch.logsumexp(x, 1) for x in softened]).sum(0) / _SHARPNESS
    return chosen, weights, value


def _terms(
    problem: SeedProblem, states: Motion, vectors: Tensor, weights: Tensor, penalty: Penalty | None
) -> tuple[Tensor, Tensor]:
    """Weighted torque energies, whose gradient is that of the fitness, and penalty: sums over time, (B,)."""
    constraints = problem.constraints
    own = penalty is not None and constraints.torque
    if own:
        parameters = constraints.arm.inertial_parameters.reshape(1, 1, -1).expand(len(vectors), 1, -1)
        vectors = torch.cat([vectors, parameters], 1)
    torques = problem.body.torques_of(*states[1:], vectors)
    energy = (torques[:, : weights.shape[1]] ** 2).sum((2, 3))
    excess = torch.zeros_like(energy[:, 0])
    if penalty is not None:
        torque = torques[:, -1] if own else None
        excess = penalty.weight * _violation(problem, states.position, states.velocity, torque, penalty)
    return (weights * energy).sum(1), excess


def _violation(
    problem: SeedProblem, q: Tensor, dq: Tensor, torque: Tensor | None, penalty: Penalty
) -> Tensor:
    """Sum over constraints and time of the squared relative violation, (B,)."""
    arm = problem.constraints.arm
    room = (arm.position_upper - arm.position_lower) / 2
    position = torch.minimum(q - arm.position_lower, arm.position_upper - q) / room
    parts = [penalty.limits - position, penalty.limits + dq.abs() / arm.velocity_limit - 1]
    if torque is not None:
        parts.append(penalty.torque + torque.abs() / arm.torque_limit - 1)
    shape = q.shape[:2]
    for distance in problem.constraints.clearances(q.reshape(-1, q.shape[-1])).values():
        parts.append(penalty.distance - distance.reshape(*shape, -1) / _DISTANCE)
    return torch.stack([(part.clamp_min(0) ** 2).sum((1, 2)) for part in parts]).sum(0)
