"""What violated constraints cost: squared relative violations, and their gradients in the states."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from sidegan.design.problem import Problem
from sidegan.motion.compiled import tensors as kernels
from sidegan.motion.compiled.limits import Limits, Near
from sidegan.motion.trajectory import Motion
from sidegan.validity import Plane

_DISTANCE = 0.25  # [m] clearance that counts like a whole limit


@dataclass(frozen=True)
class Penalty:
    """How strongly violations count, and the share of each limit that is kept in reserve."""

    weight: float
    limits: float = 0.05
    torque: float = 0.05
    distance: float = 0.1

    @classmethod
    def reserving(cls, weight: float, reserve: float) -> "Penalty":
        """A share of each position, velocity and torque limit, and twice that share of 0.25 m, in reserve."""
        return cls(weight, limits=reserve, torque=reserve, distance=2 * reserve)

    @property
    def reach(self) -> float:
        """Smallest distance that costs nothing [m]."""
        return self.distance * _DISTANCE

    def near(self, distance: Tensor) -> Tensor:
        """Squares of what distances [m], (B, T, K), lack, summed, (B,); without the weight."""
        return excess(self.distance - distance / _DISTANCE)


def excess(violation: Tensor) -> Tensor:
    """Sum over time and constraints of the squares of positive violations (B, T, K), (B,)."""
    return (violation.clamp_min(0) ** 2).sum((1, 2))


def costs(problem: Problem, states: Motion, penalty: Penalty) -> tuple[Tensor, list[Tensor]]:
    """Penalty summed over time, (B,), and its gradients in q, dq and ddq."""
    with torch.enable_grad():
        q, dq, ddq = (x.detach().requires_grad_(True) for x in states[1:])
        total = _limit_excess(problem, (q, dq, ddq), penalty) + _distance_excess(problem, q, penalty)
        slopes = torch.autograd.grad(total.sum(), (q, dq, ddq), materialize_grads=True)
    return penalty.weight * total.detach(), [penalty.weight * slope for slope in slopes]


def _limit_excess(problem: Problem, states: tuple[Tensor, ...], penalty: Penalty) -> Tensor:
    (q, dq, _), arm = states, problem.constraints.arm
    middle, room = _positions(problem)
    parts = [(q - middle).abs() / room, dq.abs() / arm.velocity_limit]
    violations = [penalty.limits + part - 1 for part in parts]
    if problem.constraints.torque:
        violations.append(penalty.torque + problem.body.torque(*states).abs() / arm.torque_limit - 1)
    return torch.stack([excess(violation) for violation in violations]).sum(0)


def _distance_excess(problem: Problem, q: Tensor, penalty: Penalty) -> Tensor:
    total = torch.zeros_like(q[:, 0, 0])
    for distance in problem.constraints.clearances(q.flatten(0, 1)).values():
        total = total + penalty.near(distance.reshape(*q.shape[:2], -1))
    return total


def compiled_costs(problem: Problem, penalty: Penalty) -> tuple[Limits, Near] | None:
    """The same for compiled kernels; None where a region is no plane."""
    constraints = problem.constraints
    regions = [region for region in constraints.regions if isinstance(region, Plane)]
    if len(regions) < len(constraints.regions):
        return None
    numbers = [[*region.normal, region.offset] for region in regions]
    planes = torch.tensor(numbers, dtype=torch.float64).reshape(-1, 4)
    arm, capsules = constraints.arm, constraints.arm.capsules
    torque = arm.torque_limit if constraints.torque else torch.full_like(arm.torque_limit, torch.inf)
    vectors = [*_positions(problem), arm.velocity_limit, torque, arm.inertial_parameters.flatten()]
    arrays = [np.ascontiguousarray(x.numpy()) for x in vectors]
    shapes = [capsules.link, torch.stack([capsules.a, capsules.b]), capsules.radius]
    shapes += [constraints.pairs, constraints.guarded, planes]
    limits = Limits(penalty.weight, penalty.limits, penalty.torque, *arrays)
    return limits, Near(penalty.weight / _DISTANCE**2, penalty.reach, shapes)


def _positions(problem: Problem) -> tuple[Tensor, Tensor]:
    """Middle of the joint positions, and room to both sides of it [rad or m], (J,) each."""
    arm = problem.constraints.arm
    return (arm.position_upper + arm.position_lower) / 2, (arm.position_upper - arm.position_lower) / 2


def pushes(
    problem: Problem, states: Motion, directions: tuple[Tensor, Tensor] | None, penalty: Penalty | None
) -> tuple[Tensor, list[Tensor]]:
    """Penalty summed over time, (B,), and the gradients of penalty and energy in q, dq and ddq.

    The energy is Σ weight · |Y v|² over time and directions: vectors v, (B, K, 10 J), and weights, (B, K).
    """
    q, body = states.position, problem.body
    compiled = penalty and compiled_costs(problem, penalty) if kernels.usable(*states[1:]) else None
    if compiled:
        vectors, weights = directions or (q.new_zeros(len(q), 0, 10 * body.joints), q.new_zeros(len(q), 0))
        return kernels.penalised_slopes(body.chain, states[1:], vectors, weights, *compiled)
    total, slopes = q.new_zeros(len(q)), [torch.zeros_like(x) for x in states[1:]]
    if directions is not None:
        slopes = body.energy_slopes(*states[1:], *directions)
    if penalty is not None:
        total, more = costs(problem, states, penalty)
        slopes = [x + y for x, y in zip(slopes, more)]
    return total, slopes
