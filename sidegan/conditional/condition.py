"""A batch of conditions as tensors, and what one of them amounts to."""

import math
from dataclasses import dataclass, fields, replace
from typing import Any

import torch
from torch import Tensor

from sidegan.errors import ShapeError
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Box, Constraints, Plane, Region


@dataclass(frozen=True, eq=False)
class Condition:
    """Conditions of B trajectories; float64."""

    home: Tensor  # joint positions at both ends [rad or m], (B, J)
    period: Tensor  # [s], (B,)
    velocity: Tensor  # share of the velocity limits that may be used, (B,)
    torque: Tensor  # share of the torque limits that may be used, (B,)
    plane: Tensor  # height that no link that can help it goes below [m], (B,); −∞ for none
    walls: Tensor  # half-widths in x and y of a room around the world's origin [m], (B, 2); ∞ for none
    obstacle: Tensor  # centre and half edge of a cube to keep out of [m], (B, 4); half edge 0 for none
    links: Tensor  # how much the parameters of each link matter beside the condition number, (B, J)

    def __post_init__(self) -> None:
        count, joints = self.home.shape if self.home.ndim == 2 else (-1, -1)
        shapes = {"home": (joints,), "walls": (2,), "obstacle": (4,), "links": (joints,)}
        for name, x in self.columns().items():
            expected = (count, *shapes.get(name, ()))
            if x.shape != expected:
                raise ShapeError(f"{name} of a condition is {tuple(x.shape)}, expected {expected}")
            object.__setattr__(self, name, x.double())

    def __len__(self) -> int:
        return len(self.home)

    def columns(self) -> dict[str, Tensor]:
        """Every tensor by its name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def take(self, rows: Tensor) -> "Condition":
        """The conditions at these indices, or where a mask is true."""
        return replace(self, **{name: x[rows] for name, x in self.columns().items()})

    def repeat(self, times: int) -> "Condition":
        """Each condition so many times in a row."""
        return replace(self, **{name: x.repeat_interleave(times, 0) for name, x in self.columns().items()})

    def row(self, index: int) -> "Condition":
        """One of the conditions, as a batch of one."""
        return self.take(torch.tensor([index]))

    def describe(self) -> dict[str, Any]:
        """Plain values of a batch of one, for people and for files; None for what there is not."""
        plain: dict[str, Any] = {}
        for name, x in self.columns().items():
            values = [v if abs(v) < torch.inf else None for v in x[0].flatten().tolist()]
            plain[name] = values if x.ndim > 1 else values[0]
        return plain

    def family(self, trajectory: Trajectory) -> Trajectory:
        """Family of trajectories with the home and the period of a batch of one."""
        return replace(trajectory, period=float(self.period[0]), home=self.home[0].tolist())

    def regions(self) -> list[Region]:
        """Regions that a batch of one requests to keep out of."""
        height, widths = float(self.plane[0]), self.walls[0].tolist()
        regions: list[Region] = [Plane((0.0, 0.0, 1.0), height)] if height > -math.inf else []
        for (x, y), width in zip(((1.0, 0.0), (0.0, 1.0)), widths):
            if width < math.inf:
                regions += [Plane((sign * x, sign * y, 0.0), -width) for sign in (1.0, -1.0)]
        *centre, half = self.obstacle[0].tolist()
        if half > 0:
            regions.append(Box(tuple(x - half for x in centre), tuple(x + half for x in centre)))
        return regions

    def constraints(self, workspace: Constraints) -> Constraints:
        """The arm in its workspace with the regions and the shares of the limits of a batch of one."""
        arm = workspace.arm
        velocity, torque = arm.velocity_limit * self.velocity[0], arm.torque_limit * self.torque[0]
        arm = replace(arm, velocity_limit=velocity, torque_limit=torque)
        regions = [*workspace.regions, *self.regions()]
        return Constraints(arm, regions, workspace.torque, workspace.clearance)

    @staticmethod
    def cat(parts: "list[Condition]") -> "Condition":
        """One batch of several."""
        names = parts[0].columns()
        return Condition(**{name: torch.cat([getattr(part, name) for part in parts]) for name in names})
