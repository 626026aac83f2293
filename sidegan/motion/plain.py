"""Dynamics of batches in plain torch: the readable reference, for any device and type, derivable at will."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from sidegan.motion import newton_euler
from sidegan.motion.compiled.limits import Limits, Near
from sidegan.motion.threads import eigh

if TYPE_CHECKING:
    from sidegan.motion.dynamics import RigidBody

States = Sequence[Tensor]

_VALUES_AT_ONCE = 4_000_000  # of the full regressor: 32 MB, and four times that in intermediate results


def states_at_once(joints: int) -> int:
    """How many states to hold at a time."""
    return max(1, _VALUES_AT_ONCE // (10 * joints**2))


def regressor(body: "RigidBody", states: States) -> Tensor:
    """Full regressor, (…, J, 10 J), of states (…, J)."""
    y = newton_euler.regressor(body.chain, newton_euler.states_last(states))
    return y.permute(2, 0, 1).reshape(*states[0].shape, 10 * body.joints)


def gram(body: "RigidBody", columns: Tensor, states: States) -> Tensor:
    """Gram matrices YᵀY / T of columns (p,) of the regressor, (B, p, p), of states (B, T, J)."""
    batch, count, joints = states[0].shape
    most = states_at_once(joints)
    if count > most:
        parts = zip(*(x.split(most, 1) for x in states))
        return torch.stack([gram(body, columns, part) * part[0].shape[1] for part in parts]).sum(0) / count
    y = newton_euler.regressor(body.chain, newton_euler.states_last(states))[:, columns.to(states[0].device)]
    y = y.reshape(joints, len(columns), batch, count).permute(2, 1, 0, 3).flatten(2)
    return y @ y.transpose(1, 2) / count


def torques(body: "RigidBody", states: States, sets: Tensor) -> Tensor:
    """Torques (B, K, T, J) of states (B, T, J) and parameter sets (B, K, 10 J)."""
    batch, count, joints = states[0].shape
    size = sets.shape[1]
    v = sets.permute(2, 1, 0).reshape(joints, 10, size, batch, 1)
    if batch > 1:
        v = v.expand(joints, 10, size, batch, count)
    v = v.flatten(3)
    torque = newton_euler.torque(body.chain, newton_euler.states_last(states), v)
    return torque.reshape(joints, size, batch, count).permute(2, 1, 3, 0)


def sums(body: "RigidBody", states: States, torque: Tensor) -> Tensor:
    """Each joint's sums of products of base columns and torque, (J, p + 1, p + 1), over S samples (S, J)."""
    parts = zip(*(x.split(states_at_once(body.joints)) for x in (*states, torque)))
    rows = (torch.cat([body.base_regressor(*x), tau[..., None]], 2).transpose(0, 1) for *x, tau in parts)
    return sum((y.mT @ y for y in rows), torque.new_zeros(()))


@torch.enable_grad()
def penalised_slopes(
    body: "RigidBody", states: States, sets: Tensor, weights: Tensor, limits: Limits, near: Near | None
) -> tuple[Tensor, list[Tensor]]:
    """Penalty, (B,), and gradients in the states, (B, T, J) each, of it and of Σ weight · |Y v|²."""
    x = [state.detach().requires_grad_(True) for state in states]
    cost = _limit_cost(body, x, limits) + (0.0 if near is None else _distance_cost(near, x[0]))
    total = cost.sum()
    if sets.shape[1]:
        total = total + (weights * (torques(body, x, sets) ** 2).sum((2, 3))).sum()
    return cost.detach(), list(torch.autograd.grad(total, x, materialize_grads=True))


def extremes(x: Tensor, low: int, high: int) -> tuple[Tensor, Tensor]:
    """The ``low`` smallest and ``high`` largest of p > low + high eigenvalues, and eigenvectors."""
    values, vectors = eigh(x)
    ends = [*range(low), *range(x.shape[1] - high, x.shape[1])]
    return values[:, ends], vectors[:, :, ends]


def _limit_cost(body: "RigidBody", states: States, limits: Limits) -> Tensor:
    q, dq, _ = states
    middle, room, speed, most, own = (torch.from_numpy(x).to(q) for x in limits[3:])
    uses = [(q - middle).abs() / room + limits.reserve, dq.abs() / speed + limits.reserve]
    if limits.weight and np.isfinite(limits.torque).any():
        torque = torques(body, states, own.expand(len(q), 1, -1))[:, 0]
        uses.append(torque.abs() / most + limits.torque_reserve)
    excess = torch.stack([((use - 1).clamp_min(0) ** 2).sum((1, 2)) for use in uses])
    return limits.weight * excess.sum(0)


def _distance_cost(near: Near, q: Tensor) -> Tensor:
    lack = (near.reach - near.distances(q.flatten(0, 1))).clamp_min(0)
    return near.weight * (lack**2).sum(1).reshape(q.shape[:2]).sum(1)
