"""Columns of conditions: the range of each, how it is drawn, what the network sees of it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from sidegan.conditional.settings import Ranges
from sidegan.errors import ConfigError
from sidegan.motion.trajectory import Trajectory

Numbers = float | Sequence[float] | Tensor

_SAME = 1e-6  # by which a number may lie outside a range


@dataclass(frozen=True, eq=False)
class Column:
    """Range of one column of conditions, each end (K,) for columns of K numbers."""

    kind: str  # of conditions that request it
    low: Tensor  # lower end
    high: Tensor  # upper end
    neutral: Tensor  # what holds where it is not requested
    logarithmic: bool = False  # whether it is drawn and encoded by its logarithm

    def at(self, share: Tensor) -> Tensor:
        """Numbers at these shares of the range, (B, K)."""
        low, high = (x.log() if self.logarithmic else x for x in (self.low, self.high))
        x = low + (high - low) * share
        return x.exp() if self.logarithmic else x

    def centred(self, x: Tensor) -> Tensor:
        """Numbers of the range as −1 … 1, (B, K); zero where the range is one number."""
        low, high = (end.log() if self.logarithmic else end for end in (self.low, self.high))
        x = x.log() if self.logarithmic else x
        flat = ((2 * x - low - high) / (high - low)).reshape(len(x), -1)
        return torch.where(high == low, 0.0, flat)

    def refuse_outside(self, name: str, x: Tensor) -> None:
        """Refuse numbers (1, K) that the generator was not trained for."""
        low, high = self.low.expand_as(x), self.high.expand_as(x)
        if not ((x >= low - _SAME) & (x <= high + _SAME)).all():
            trained = f"{_listed(low)} to {_listed(high)}"
            raise ConfigError(f"{name} is {_listed(x)}, but the generator is trained for {trained}")


def columns_of(ranges: Ranges, trajectory: Trajectory, links: Tensor) -> dict[str, Column]:
    """The columns of conditions, in the order in which they are drawn and encoded.

    The trajectory's home and period hold where no other is requested; only ``links`` that have parameters of
    their own, (J,), can be.
    """
    home, period = _tensor(trajectory.home or ()), trajectory.period
    plane = ranges.plane or (-math.inf, -math.inf)
    walls = ranges.walls or (math.inf, math.inf)
    cubes, none = ranges.obstacle, [0.0] * 4
    low = none if cubes is None else [*cubes.lower, cubes.half[0]]
    high = none if cubes is None else [*cubes.upper, cubes.half[1]]
    weight = links.double() if ranges.links else 0.0 * home
    return {
        "home": _column("home", home - ranges.home, home + ranges.home, home),
        "period": _column("period", *(ranges.period or (period, period)), period, logarithmic=True),
        "velocity": _column("effort", *ranges.velocity, ranges.velocity[1]),
        "torque": _column("effort", *ranges.torque, ranges.torque[1]),
        "plane": _column("plane", *plane, plane[0]),
        "walls": _column("walls", walls[:1] * 2, walls[1:] * 2, walls[1:] * 2),
        "obstacle": _column("obstacle", low, high, none),
        "links": _column("links", 0.0 * home, weight, 0.0 * home),
    }


def _column(kind: str, low: Numbers, high: Numbers, neutral: Numbers, logarithmic: bool = False) -> Column:
    return Column(kind, _tensor(low), _tensor(high), _tensor(neutral), logarithmic)


def _tensor(x: Numbers) -> Tensor:
    return torch.as_tensor(x, dtype=torch.float64)


def _listed(x: Tensor) -> str:
    return str([round(float(v), 4) for v in x.flatten()])
