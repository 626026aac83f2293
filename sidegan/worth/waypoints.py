"""Moves from rest to rest through waypoints: what others' optimisers give, such as FIGAROH's."""

from dataclasses import asdict, dataclass
from typing import Any

import torch
from torch import Tensor

from sidegan.motion.trajectory import Motion
from sidegan.validity import Constraints

_RATE = 200.0  # [Hz] at which motions are looked at for violations


@dataclass(frozen=True)
class Rests:
    """Moves of minimum jerk that take equally long, a rest of no length after each."""

    period: float  # of all moves together [s]

    def roll_out(self, points: Tensor, times: Tensor) -> Motion:
        """Motions (B, T, J) through waypoints (B, J, K + 1) at times (T,) within the period."""
        step = self.period / (points.shape[2] - 1)
        move = (times / step).floor().long().clamp(0, points.shape[2] - 2)
        s = times / step - move
        start, way = points[:, :, move], points.diff(dim=2)[:, :, move]
        shapes = (
            s**3 * (10 - 15 * s + 6 * s**2),
            30 * s**2 * (1 - s) ** 2 / step,
            60 * s * (1 - s) * (1 - 2 * s) / step**2,
        )
        q, dq, ddq = ((way * shape).mT for shape in shapes)
        return Motion(times, start.mT + q, dq, ddq)

    def describe(self) -> dict[str, Any]:
        """What it takes to make the same one again."""
        return asdict(self)

    def violations(self, constraints: Constraints, points: Tensor) -> dict[str, float]:
        """Share of the time in which motions through waypoints (B, J, K + 1) violate each constraint."""
        times = torch.arange(round(self.period * _RATE), dtype=torch.float64) / _RATE
        states = [x.flatten(0, 1) for x in self.roll_out(points, times)[1:]]
        states += [torch.zeros_like(states[0])] if "jerk" in constraints.higher else []
        margins = constraints.margins(*states)
        return {name: float((x.flatten(1) < 0).any(1).double().mean()) for name, x in margins.items()}
