"""Value and exact gradient of the penalised condition number, for a whole batch at once.

For an eigenpair (λ, v) of YᵀY, dλ = 2 (Y v)ᵀ d(Y v), and Y v is the torque of the robot whose
inertial parameters are v: the gradient of any function of a few eigenvalues costs a few inverse
dynamics, never a differentiated regressor.
"""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from sidegan.design.problem import HOPELESS, Problem
from sidegan.motion.compiled import tensors as kernels
from sidegan.motion.compiled.limits import Limits, Near
from sidegan.motion.trajectory import Motion
from sidegan.validity import Plane

_DISTANCE = 0.25  # [m] clearance that counts like a whole joint range in the penalty
_STATES_AT_ONCE = 8_192  # bounds the memory of a gradient to about 300 MB for seven joints
# The smallest eigenvalue changes places with its neighbours all the time; a smooth minimum over a few
# spares the optimiser the kinks: 20 % lower condition numbers after as many steps.
LOWEST, HIGHEST, SHARPNESS = 3, 2, 6.0


@dataclass(frozen=True)
class Penalty:
    """How strongly violations count, and the share of each limit that is kept in reserve."""

    weight: float
    limits: float = 0.05
    torque: float = 0.05
    distance: float = 0.1


def value_and_gradient(problem: Problem, c: Tensor, penalty: Penalty | None) -> tuple[Tensor, Tensor]:
    """Smooth log fitness plus penalty, (B,), and its gradient, (B, J, H, 2), at coefficients c."""
    vectors, weights, value = _directions(problem, c.detach())
    violation, gradient = pull_back(problem, c, (vectors, weights), penalty)
    return value + violation, gradient


def pull_back(
    problem: Problem, c: Tensor, directions: tuple[Tensor, Tensor] | None, penalty: Penalty | None
) -> tuple[Tensor, Tensor]:
    """Penalty, (B,), and the gradient of penalty and energy, (B, J, H, 2), at coefficients c.

    The energy is Σ weight · |Y v|² / T over the directions: for eigenvectors of YᵀY / T and the slopes of a
    function of its eigenvalues, its gradient is that function's. Works through the states in pieces, then
    carries the gradient from the motion back to the coefficients, in which it is linear: memory does not
    grow with the number of samples.

    Args:
        problem: the trajectories and what constrains them.
        c: coefficients [rad/s], (B, J, H, 2).
        directions: parameter vectors v, (B, K, 10 J), and weights, (B, K); None for no energy.
        penalty: of violations; None for none.
    """
    with torch.enable_grad():
        c = c.detach().requires_grad_(True)
        motion = problem.motion(c)
    slopes = [torch.zeros_like(x) for x in motion[1:]]
    violation = c.new_zeros(len(c))
    batch, times = max(1, _STATES_AT_ONCE // problem.samples), min(problem.samples, _STATES_AT_ONCE)
    for rows in torch.arange(len(c)).split(batch):
        for columns in torch.arange(problem.samples).split(times):
            piece = (slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1))
            states = Motion(motion.time[piece[1]], *(x[piece].detach() for x in motion[1:]))
            given = None if directions is None else tuple(x[piece[0]] for x in directions)
            excess, found = _pushes(problem, states, given, penalty)
            violation[piece[0]] += excess / problem.samples
            for slope, x in zip(slopes, found):
                slope[piece] = x / problem.samples
    (gradient,) = torch.autograd.grad(motion[1:], c, slopes)
    return violation, gradient


def smooth_fitness(problem: Problem, c: Tensor) -> Tensor:
    """Smooth log fitness, (B,): at most (log 3 + log 2) / 6 above the logarithm of the fitness."""
    return _directions(problem, c.detach())[2]


@torch.no_grad()
def _directions(problem: Problem, c: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Parameter vectors (B, K, 10 J), weights ∂f/∂λ (B, K), and the smooth log fitness f (B,)."""
    base = problem.body.base
    grams = problem.gram(c)
    if problem.diagonal:
        values, order = grams.diagonal(dim1=1, dim2=2).sort(1)
        vectors = torch.nn.functional.one_hot(order, len(base.columns)).to(c)
    else:
        values, eigenvectors = kernels.extremes(base.subspace.T @ grams @ base.subspace, LOWEST, HIGHEST)
        vectors = (base.subspace @ eigenvectors).transpose(1, 2)
    values = torch.maximum(values, values[:, -1:] / HOPELESS)
    low, high = values[:, :LOWEST], values[:, -HIGHEST:]
    softened = [-SHARPNESS * torch.log(low), SHARPNESS * torch.log(high)]
    weights = torch.cat([-torch.softmax(softened[0], 1) / low, torch.softmax(softened[1], 1) / high], 1)
    chosen = c.new_zeros(len(c), weights.shape[1], 10 * problem.body.joints)
    chosen[:, :, base.columns] = torch.cat([vectors[:, :LOWEST], vectors[:, -HIGHEST:]], 1)
    value = torch.stack([torch.logsumexp(x, 1) for x in softened]).sum(0) / SHARPNESS
    return chosen, weights, value


def _pushes(
    problem: Problem, states: Motion, directions: tuple[Tensor, ...] | None, penalty: Penalty | None
) -> tuple[Tensor, list[Tensor]]:
    """Penalty summed over time, (B,), and the gradients of penalty and energy in q, dq and ddq."""
    q = states.position
    planes = _planes(problem) if kernels.usable(*states[1:]) else None
    if penalty is not None and planes is not None:
        none = q.new_zeros(len(q), 0, 10 * problem.body.joints), q.new_zeros(len(q), 0)
        vectors, weights = directions or none
        given = _limits(problem, penalty), _near(problem, planes, penalty)
        return kernels.penalised_slopes(problem.body.chain, states[1:], vectors, weights, *given)
    found = [torch.zeros_like(x) for x in states[1:]]
    if directions is not None:
        found = problem.body.energy_slopes(*states[1:], *directions)
    if penalty is None:
        return q.new_zeros(len(q)), found
    excess, pushes = _penalty(problem, states, penalty)
    return excess, [x + push for x, push in zip(found, pushes)]


@torch.enable_grad()
def _penalty(problem: Problem, states: Motion, penalty: Penalty) -> tuple[Tensor, list[Tensor]]:
    """Penalty summed over time, (B,), and its gradients in q, dq and ddq."""
    q, dq, ddq = (x.requires_grad_(True) for x in states[1:])
    torque = problem.body.torque(q, dq, ddq) if problem.constraints.torque else None
    excess = _limit_excess(problem, q, dq, torque, penalty) + _distance_excess(problem, q, penalty)
    pushes = torch.autograd.grad(excess.sum(), (q, dq, ddq), materialize_grads=True)
    return penalty.weight * excess.detach(), [penalty.weight * push for push in pushes]


def _limit_excess(problem: Problem, q: Tensor, dq: Tensor, torque: Tensor | None, penalty: Penalty) -> Tensor:
    """Sum over joints and time of the squared relative violation of limits, (B,)."""
    arm = problem.constraints.arm
    middle, room = (
        (arm.position_upper + arm.position_lower) / 2,
        (arm.position_upper - arm.position_lower) / 2,
    )
    parts = [(q - middle).abs() / room, dq.abs() / arm.velocity_limit]
    uses = [penalty.limits + part - 1 for part in parts]
    if torque is not None:
        uses.append(penalty.torque + torque.abs() / arm.torque_limit - 1)
    return torch.stack([(use.clamp_min(0) ** 2).sum((1, 2)) for use in uses]).sum(0)


def _distance_excess(problem: Problem, q: Tensor, penalty: Penalty) -> Tensor:
    """The same of distances, (B,)."""
    excess = torch.zeros_like(q[:, 0, 0])
    for distance in problem.constraints.clearances(q.reshape(-1, q.shape[-1])).values():
        part = penalty.distance - distance.reshape(*q.shape[:2], -1) / _DISTANCE
        excess = excess + (part.clamp_min(0) ** 2).sum((1, 2))
    return excess


def _limits(problem: Problem, penalty: Penalty) -> Limits:
    """What ``_limit_excess`` is of, for compiled kernels."""
    arm = problem.constraints.arm
    low, high = arm.position_lower, arm.position_upper
    torque = arm.torque_limit if problem.constraints.torque else torch.full_like(arm.torque_limit, torch.inf)
    numbers = [
        (high + low) / 2,
        (high - low) / 2,
        arm.velocity_limit,
        torque,
        arm.inertial_parameters.flatten(),
    ]
    arrays = [np.ascontiguousarray(x.numpy()) for x in numbers]
    return Limits(penalty.weight, penalty.limits, penalty.torque, *arrays)


def _near(problem: Problem, planes: Tensor, penalty: Penalty) -> Near:
    """What ``_distance_excess`` is of, for compiled kernels, where all regions are planes."""
    constraints, capsules = problem.constraints, problem.constraints.arm.capsules
    shapes = [capsules.link, torch.stack([capsules.a, capsules.b]), capsules.radius]
    shapes += [constraints.pairs, constraints.guarded, planes]
    return Near(penalty.weight / _DISTANCE**2, penalty.distance * _DISTANCE, shapes)


def _planes(problem: Problem) -> Tensor | None:
    """Normals and offsets of the keep-out regions, (R, 4); None where one is no plane."""
    regions = [region for region in problem.constraints.regions if isinstance(region, Plane)]
    if len(regions) < len(problem.constraints.regions):
        return None
    numbers = [[*region.normal, region.offset] for region in regions]
    return torch.tensor(numbers, dtype=torch.float64).reshape(-1, 4)
