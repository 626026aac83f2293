"""How much margins can change between a sample and the edge of its cell: what kernels need for upper bounds.

From a sample's derivatives and a bound on the next one follow bounds on the joints' motion in the cell; from
those, by triangle inequalities alone (``sidegan.kernels.formulas``), bounds on capsules' motion and torques.
"""

from typing import NamedTuple

import torch
from torch import Tensor

from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm

COARSE = 0.1  # [s] longest cell of the first pass
SPLIT = 3  # parts that a cell is cut into where it cannot be decided
ORDERS = 5  # derivatives of the motion, from none on, that kernels take
LEVELS = 7  # passes: the last one's cells are 0.1 s / 3⁶ = 0.14 ms long
_SAMPLES_AT_ONCE = 200_000  # of the jerk: 11 MB for seven joints


def coarse_cells(trajectory: Trajectory) -> int:
    """Number of cells of the first pass over one trajectory."""
    return int(-(-trajectory.period // COARSE))


def jerk_bound(trajectory: Trajectory, c: Tensor, cells: int) -> Tensor:
    """Upper bound of the absolute jerk [rad/s³] over the whole period, (B, J)."""
    times = trajectory.grid(cells)
    snap = derivative_bound(trajectory, c, 4)
    parts = c.split(max(1, _SAMPLES_AT_ONCE // cells))
    sampled = torch.cat([trajectory.derivative(part, times, 3).abs().amax(1) for part in parts])
    return sampled + snap * (trajectory.period / cells / 2)


def derivative_bound(trajectory: Trajectory, c: Tensor, order: int) -> Tensor:
    """Upper bound of the absolute derivative ``order``, 4 or more, over the whole period, (B, J)."""
    return torch.einsum("bjhx,hx->bj", c.abs(), trajectory.derivative_bound(order).to(c))


class Reaches(NamedTuple):
    """How far the motion of each joint can change distances [m per rad or m]."""

    pairs: Tensor  # of capsules, (P, J)
    pieces: Tensor  # of what is inside of them, (P, J)
    regions: Tensor  # of guarded capsules to their regions, (K, J)

    @property
    def largest(self) -> Tensor:
        """The largest of each joint to any capsule or region, (1, J); zero where there is none."""
        none = torch.zeros(1, self.regions.shape[1]).double()
        return torch.cat([self.pairs, self.regions, none]).amax(0, keepdim=True)

    @classmethod
    def of(cls, arm: Arm, pairs: Tensor, guarded: Tensor) -> "Reaches":
        """Reaches of pairs of capsules, (P, 2), and of regions and capsules, (K, 2).

        Between two capsules only the joints between their links count, and they carry the outer one.
        """
        link, reach = arm.capsules.link, capsule_reach(arm)
        first, second = link[pairs].unbind(1)
        outer = torch.where(first > second, pairs[:, 0], pairs[:, 1])
        joints, far = torch.arange(arm.joints), torch.maximum(first, second)[:, None]
        between = (joints[None] > torch.minimum(first, second)[:, None]) & (joints[None] <= far)
        return cls(reach[outer] * between, piece_reach(arm)[outer] * between, reach[guarded[:, 1]])


def travel(arm: Arm) -> Tensor:
    """Upper bound of the distance [m] between a joint's frame and its parent's, (J,)."""
    slide = torch.maximum(arm.position_lower.abs(), arm.position_upper.abs())
    return arm.translation.norm(dim=1) + torch.where(arm.prismatic, slide, torch.zeros_like(slide))


def capsule_reach(arm: Arm) -> Tensor:
    """Largest speed [m per rad or m] that unit speed of a joint gives a point of a capsule's axis, (C, J).

    The distance of a point to a joint's axis is at most that of the next joint's origin (which turning
    about the axis does not change) plus the lengths from there outwards.
    """
    return _reach(arm, [*torch.stack([arm.capsules.a, arm.capsules.b], 1)])


def piece_reach(arm: Arm) -> Tensor:
    """Reach of a point of the hull inside of each capsule, (C, J)."""
    pieces = arm.capsules.pieces
    if pieces is None:
        return capsule_reach(arm)
    return _reach(arm, [*pieces.corners.split(pieces.start.diff().tolist())])


def _reach(arm: Arm, bodies: list[Tensor]) -> Tensor:
    """Largest speed [m per rad or m] that a joint gives the corners (V, 3) of each capsule's body, (C, J)."""
    travels = travel(arm)
    reach = torch.zeros(len(bodies), arm.joints, dtype=torch.float64)
    for k, (link, corners) in enumerate(zip(arm.capsules.link.tolist(), bodies)):
        for j in range(link + 1):
            if arm.prismatic[j]:
                reach[k, j] = 1.0
            elif j == link:
                reach[k, j] = _from_axis(arm, j, corners).max()
            else:
                step = travels[j + 1] if arm.prismatic[j + 1] else _from_axis(arm, j, arm.translation[j + 1])
                reach[k, j] = step + travels[j + 2 : link + 1].sum() + corners.norm(dim=1).max()
    return reach


def _from_axis(arm: Arm, joint: int, points: Tensor) -> Tensor:
    """Distance [m] of points (…, 3) from a joint's axis, (…)."""
    return torch.linalg.cross(arm.axis[joint].expand_as(points), points).norm(dim=-1)
