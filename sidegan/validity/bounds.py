"""How much margins can change between a sample and the edge of its cell: what kernels need for upper bounds.

From a sample's derivatives and a bound on the next one follow bounds on the joints' motion in the cell; from
those, by triangle inequalities alone (``sidegan.kernels.formulas``), bounds on capsules' motion and torques.
"""

from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm

COARSE = 0.1  # [s] longest cell of the first pass
SPLIT = 3  # parts that a cell is cut into where it cannot be decided
ORDERS = 5  # derivatives of the motion, from none on, that kernels take
LEVELS = 7  # passes: the last one's cells are 0.1 s / 3⁶ = 0.14 ms long


def coarse_cells(trajectory: Trajectory) -> int:
    """Number of cells of the first pass over one trajectory."""
    return int(-(-trajectory.period // COARSE))


def jerk_bound(trajectory: Trajectory, c: Array, cells: int) -> Array:
    """Upper bound of the absolute jerk [rad/s³] over the whole period, (B, J)."""
    times = trajectory.grid(cells)
    sampled = np.abs(trajectory.derivative(c, times, 3)).max(1)
    return sampled + derivative_bound(trajectory, c, 4) * (trajectory.period / cells / 2)


def derivative_bound(trajectory: Trajectory, c: Array, order: int) -> Array:
    """Upper bound of the absolute derivative ``order``, 4 or more, over the whole period, (B, J)."""
    return np.einsum("bjhx,hx->bj", np.abs(c), trajectory.derivative_bound(order))


class Reaches(NamedTuple):
    """How far the motion of each joint can change distances [m per rad or m]."""

    pairs: Array  # of capsules, (P, J)
    pieces: Array  # of what is inside of them, (P, J)
    regions: Array  # of guarded capsules to their regions, (K, J)

    @property
    def largest(self) -> Array:
        """The largest of each joint to any capsule or region, (1, J); zero where there is none."""
        none = np.zeros((1, self.regions.shape[1]))
        return np.concatenate([self.pairs, self.regions, none]).max(0, keepdims=True)

    @classmethod
    def of(cls, arm: Arm, pairs: Array, guarded: Array) -> "Reaches":
        """Reaches of pairs of capsules, (P, 2), and of regions and capsules, (K, 2).

        Between two capsules only the joints between their links count, and they carry the outer one.
        """
        link, reach = arm.capsules.link, capsule_reach(arm)
        first, second = link[pairs].T
        outer = np.where(first > second, pairs[:, 0], pairs[:, 1])
        joints, far = np.arange(arm.joints), np.maximum(first, second)[:, None]
        between = (joints[None] > np.minimum(first, second)[:, None]) & (joints[None] <= far)
        return cls(reach[outer] * between, piece_reach(arm)[outer] * between, reach[guarded[:, 1]])


def travel(arm: Arm) -> Array:
    """Upper bound of the distance [m] between a joint's frame and its parent's, (J,)."""
    slide = np.maximum(np.abs(arm.position_lower), np.abs(arm.position_upper))
    return np.linalg.norm(arm.translation, axis=1) + np.where(arm.prismatic, slide, 0.0)


def capsule_reach(arm: Arm) -> Array:
    """Largest speed [m per rad or m] that unit speed of a joint gives a point of a capsule's axis, (C, J).

    The distance of a point to a joint's axis is at most that of the next joint's origin (which turning
    about the axis does not change) plus the lengths from there outwards.
    """
    return _reach(arm, [*np.stack([arm.capsules.a, arm.capsules.b], 1)])


def piece_reach(arm: Arm) -> Array:
    """Reach of a point of the hull inside of each capsule, (C, J)."""
    pieces = arm.capsules.pieces
    if pieces is None:
        return capsule_reach(arm)
    return _reach(arm, np.split(pieces.corners, pieces.start[1:-1]))


def _reach(arm: Arm, bodies: list[Array]) -> Array:
    """Largest speed [m per rad or m] that a joint gives the corners (V, 3) of each capsule's body, (C, J)."""
    travels = travel(arm)
    reach = np.zeros((len(bodies), arm.joints))
    for k, (link, corners) in enumerate(zip(arm.capsules.link.tolist(), bodies)):
        for j in range(link + 1):
            if arm.prismatic[j]:
                reach[k, j] = 1.0
            elif j == link:
                reach[k, j] = _from_axis(arm, j, corners).max()
            else:
                step = travels[j + 1] if arm.prismatic[j + 1] else _from_axis(arm, j, arm.translation[j + 1])
                reach[k, j] = step + travels[j + 2 : link + 1].sum() + np.linalg.norm(corners, axis=1).max()
    return reach


def _from_axis(arm: Arm, joint: int, points: Array) -> Array:
    """Distance [m] of points (…, 3) from a joint's axis, (…)."""
    return np.linalg.norm(np.linalg.cross(arm.axis[joint], points), axis=-1)
