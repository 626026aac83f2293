"""What an arm does all day: moves from rest to rest that nobody made for identification."""

import torch
from torch import Tensor

from sidegan.errors import InfeasibleError
from sidegan.motion.moves import pick_and_place
from sidegan.motion.trajectory import Motion
from sidegan.validity import Constraints
from sidegan.worth.settings import Legs

_PEAK = 1.642  # peak acceleration of a minimum-jerk move times its way, over the square of its peak velocity
_TRIES = 2000
_LOOKS = 50.0  # [Hz] at which moves are looked at for limits and collisions
_SAFE = 0.9  # share of the limits that the fastest move uses


def legs(constraints: Constraints, settings: Legs, rate: float, generator: torch.Generator) -> list[Motion]:
    """Motions (1, T, J) at ``rate`` [Hz], each from rest to rest, free of violations where looked at.

    Raises:
        InfeasibleError: when random moves are almost never free.
    """
    moves: list[Motion] = []
    for _ in range(_TRIES):
        points, velocity = _points(constraints, settings, generator)
        if _free(constraints, pick_and_place(points, velocity, settings.rest, _LOOKS)):
            moves.append(pick_and_place(points, velocity, settings.rest, rate))
            if len(moves) == settings.count:
                return moves
    raise InfeasibleError("random moves from rest to rest are almost never free in this workspace")


def _points(constraints: Constraints, settings: Legs, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Waypoints (K, J) and the velocities of the moves between them, (J,)."""
    arm = constraints.arm
    lower, upper = arm.position_lower, arm.position_upper
    draw = torch.rand(settings.waypoints + 1, 2, arm.joints, generator=generator, dtype=torch.float64)
    low, high = settings.distance
    points = [torch.lerp(lower, upper, 0.1 + 0.8 * draw[0, 0])]
    for one in draw[1:-1]:
        way = (low + (high - low) * one[0]) * (upper - lower)
        there = points[-1] + torch.where(one[1] < 0.5, -way, way)
        points.append(torch.where((there < lower) | (there > upper), 2 * points[-1] - there, there))
    stacked = torch.stack(points)
    speed = settings.velocity * _SAFE * arm.velocity_limit
    limit = arm.acceleration_limit
    if limit is not None:
        way = stacked.diff(dim=0).abs().amin(0)
        speed = torch.minimum(speed, settings.velocity * (_SAFE * limit * way / _PEAK).sqrt())
    return stacked, speed


def _free(constraints: Constraints, motion: Motion) -> bool:
    jerk = [torch.zeros_like(motion.position[0])] if "jerk" in constraints.higher else []
    margins = constraints.margins(*(x[0] for x in motion[1:]), *jerk)
    return all(bool((margin >= 0).all()) for margin in margins.values())


def states(motions: list[Motion], step: int) -> tuple[Tensor, Tensor, Tensor]:
    """Every ``step``-th state of motions, (S, J) each."""
    parts = zip(*((x[0, ::step] for x in one[1:]) for one in motions))
    position, velocity, acceleration = (torch.cat(part) for part in parts)
    return position, velocity, acceleration
