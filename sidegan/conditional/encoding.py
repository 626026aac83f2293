"""Conditions as numbers of a range: what the network sees of them, and which lie outside."""

import math
from typing import Any

import torch
from torch import Tensor

from sidegan.conditional.condition import Condition
from sidegan.conditional.ranges import Obstacles, Range, Ranges
from sidegan.errors import ConfigError
from sidegan.motion.trajectory import Trajectory

_SAME = 1e-6  # by which a number may lie outside a range


def encode(ranges: Ranges, trajectory: Trajectory, condition: Condition) -> Tensor:
    """Conditions as numbers in [−1, 1], (B, E) float32; what cannot be asked for is left out."""
    columns = [condition.home[:, :0]]
    if ranges.home > 0:
        columns.append((condition.home - condition.home.new_tensor(trajectory.home)) / ranges.home)
    if ranges.period is not None:
        low, high = (math.log(x) for x in ranges.period)
        columns.append(_centred(condition.period.log(), (low, high)))
    if "effort" in ranges.kinds:
        columns += [_centred(condition.velocity, ranges.velocity), _centred(condition.torque, ranges.torque)]
    for name in ("plane", "walls"):
        bounds = getattr(ranges, name)
        if bounds is not None:
            columns.append(_centred(getattr(condition, name), bounds))
    if ranges.obstacle is not None:
        columns.append(_place(ranges.obstacle, condition.obstacle))
    if ranges.links:
        columns.append(condition.links)
    return torch.cat(columns, 1).clamp(-1, 1).float()


def _place(cubes: Obstacles, cube: Tensor) -> Tensor:
    """Whether there is an obstacle, where and how large, (B, 5); zeros where there is none."""
    there = cube[:, 3:] > 0
    place = [_centred(cube[:, k], (cubes.lower[k], cubes.upper[k])) for k in range(3)]
    known = torch.cat([*place, _centred(cube[:, 3], cubes.half)], 1)
    return torch.cat([2.0 * there - 1, torch.where(there, known, 0.0)], 1)


def _centred(x: Tensor, bounds: Range) -> Tensor:
    """Numbers of a range as −1 … 1, columns; zero where the range is one number."""
    low, high = bounds
    x = x.reshape(len(x), -1)
    return torch.zeros_like(x) if high == low else (2 * x - low - high) / (high - low)


def refuse_outside(ranges: Ranges, base: Condition, links: Tensor, condition: Condition) -> None:
    """Refuse a batch of one that asks for what a generator of these ranges was not trained for.

    Args:
        ranges: what may be asked for.
        base: what holds where nothing is asked for, a batch of one.
        links: largest weight of each link, (J,).
        condition: what is asked.

    Raises:
        ConfigError: with the value and its range.
    """
    still = float(base.period[0])
    bounds: dict[str, tuple[Any, Any]] = {
        "home": (base.home - ranges.home, base.home + ranges.home),
        "period": ranges.period or (still, still),
        "velocity": ranges.velocity,
        "torque": ranges.torque,
        "plane": ranges.plane or (-math.inf, -math.inf),
        "walls": ranges.walls or (math.inf, math.inf),
        "links": (0.0, links if ranges.links else 0.0),
    }
    cubes = ranges.obstacle
    if float(condition.obstacle[0, 3]) > 0:
        low = (*cubes.lower, cubes.half[0]) if cubes else (0.0,) * 4
        high = (*cubes.upper, cubes.half[1]) if cubes else (0.0,) * 4
        bounds["obstacle"] = (torch.tensor([low]), torch.tensor([high]))
    for name, (lowest, highest) in bounds.items():
        x = getattr(condition, name)
        ends = [torch.as_tensor(y, dtype=torch.float64).expand(x.shape) for y in (lowest, highest)]
        if not ((x >= ends[0] - _SAME) & (x <= ends[1] + _SAME)).all():
            trained = " to ".join(map(_words, ends))
            raise ConfigError(f"{name} is {_words(x)}, but the generator is trained for {trained}")


def _words(x: Tensor) -> str:
    return str([round(float(v), 4) for v in x.flatten()])
