"""Moves from rest to rest, as in pick and place."""

from itertools import pairwise

import torch
from torch import Tensor

from sidegan.errors import ShapeError
from sidegan.motion.trajectory import Motion

_PEAK = 1.875  # largest velocity of a minimum-jerk move, over its mean velocity


def pick_and_place(waypoints: Tensor, velocity: Tensor, rest: float, rate: float) -> Motion:
    """Motion (1, T, J) at ``rate`` [Hz] through waypoints (K, J) [rad or m], at rest in each of them.

    The joints move together with minimum jerk, so fast that the first of them reaches its ``velocity``
    [rad/s or m/s], (J,), or somewhat slower: a move lasts a whole number of samples. Between two moves, and
    before the first and after the last one, the arm rests so long [s].

    Source: Flash, Hogan 1985, The coordination of arm movements (minimum jerk).

    Raises:
        ShapeError: when there are fewer than two waypoints, or they do not fit the velocities.
    """
    if waypoints.ndim != 2 or len(waypoints) < 2 or waypoints.shape[1:] != velocity.shape:
        raise ShapeError(
            f"waypoints are {tuple(waypoints.shape)}, expected (K, {len(velocity)}) with K of two or more"
        )
    still = torch.zeros(max(1, round(rest * rate)), waypoints.shape[1], dtype=waypoints.dtype)
    parts = [(waypoints[0] + still, still, still)]
    for start, end in pairwise(waypoints):
        parts += [_move(start, end, velocity, rate), (end + still, still, still)]
    states = [torch.cat(column)[None] for column in zip(*parts)]
    return Motion(torch.arange(states[0].shape[1], dtype=waypoints.dtype) / rate, *states)


def _move(start: Tensor, end: Tensor, velocity: Tensor, rate: float) -> tuple[Tensor, Tensor, Tensor]:
    """Position, velocity and acceleration of one move, (S, J) each, its start left out and its end not."""
    way = end - start
    steps = max(1, int(torch.ceil((_PEAK * way.abs() / velocity).max() * rate)))
    period, s = steps / rate, (torch.arange(1, steps + 1, dtype=start.dtype) / steps)[:, None]
    position = start + way * (10 * s**3 - 15 * s**4 + 6 * s**5)
    speed = way * (30 * s**2 - 60 * s**3 + 30 * s**4) / period
    return position, speed, way * (60 * s - 180 * s**2 + 120 * s**3) / period**2
