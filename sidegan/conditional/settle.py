"""Trajectories that leave their region or their torque limits, brought closer to home until they do not."""

import torch
from torch import Tensor

from sidegan.conditional.condition import Condition
from sidegan.conditional.problem import ConditionedProblem
from sidegan.conditional.space import ConditionSpace

_POINTS = 120  # per period, at which everything is looked at
_KEPT = 0.01  # [m] and share of the torque limits that is kept free for what happens between the points
_HALVINGS = 6  # of the factor towards home
_AT_ONCE = 128  # trajectories: 15,000 states


@torch.no_grad()
def settle(space: ConditionSpace, condition: Condition, c: Tensor) -> Tensor:
    """Coefficients [rad/s], (B, J, H, 2), of which each keeps its condition at 120 points of its period.

    What keeps it is left as it is. The rest is made smaller, as a whole: home is clear of everything, so
    some factor above zero will do. Position and velocity limits that hold go on to do so.
    """
    parts = torch.arange(len(c)).split(_AT_ONCE)
    return torch.cat([_settle(space, condition.take(rows), c[rows].double()) for rows in parts])


def _settle(space: ConditionSpace, condition: Condition, c: Tensor) -> Tensor:
    kept = torch.minimum(torch.full_like(condition.period, _KEPT), _least(space, condition, 0 * c) / 2)
    factor = torch.ones_like(kept)
    rows = torch.nonzero(_least(space, condition, c) < kept)[:, 0]
    some, few, needed = condition.take(rows), c[rows], kept[rows]
    low, high = torch.zeros_like(needed), torch.ones_like(needed)
    for _ in range(_HALVINGS if len(rows) else 0):
        middle = (low + high) / 2
        good = _least(space, some, few * middle[:, None, None, None]) >= needed
        low, high = torch.where(good, middle, low), torch.where(good, high, middle)
    factor[rows] = low
    return c * factor[:, None, None, None]


def _least(space: ConditionSpace, condition: Condition, c: Tensor) -> Tensor:
    """Smallest distance [m] or free share of a torque limit over the period, (B,)."""
    constraints, around = space.constraints, space.surroundings
    problem = ConditionedProblem(
        constraints,
        space.trajectory,
        _POINTS,
        condition=condition,
        surroundings=around,
        torque=constraints.torque,
    )
    motion = problem.motion(c)
    q = motion.position
    near = list(around.clearances(q, condition, 2 * _KEPT).values())
    near += [x.unflatten(0, q.shape[:2]) for x in constraints.clearances(q.flatten(0, 1)).values()]
    if constraints.torque:
        used = constraints.body.torque(*motion[1:]).abs() / constraints.arm.torque_limit
        near.append(condition.torque[:, None, None] - used)
    least = [x.flatten(1).amin(1) for x in near]
    return torch.stack(least).amin(0) if least else torch.full_like(condition.period, torch.inf)
