"""Inputs to upper bounds on the change of margins between a sample and the edge of its cell.

A sample's derivatives and a bound on the next one bound the joints' motion in the cell. By triangle
inequalities alone (``sidegan.kernels.formulas``), that bounds the capsules' motion and the torques.
"""

import numpy as np

from sidegan.base.arrays import Array
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm

COARSE = 0.1  # [s] longest cell of the first pass
SPLIT = 3  # parts of an undecided cell
ORDERS = 5  # derivatives of the motion, including order 0, that kernels take
LEVELS = 7  # passes; cells of the last are 0.1 s / 3⁶ = 0.14 ms long


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


def reaches(arm: Arm, pairs: Array, guarded: Array) -> tuple[Array, Array, Array]:
    """Largest change of distances per joint motion [m per rad or m].

    Of pairs of capsules (P, 2), and of the pieces inside them, (P, J) each; and of regions and capsules
    (K, 2), (K, J). For two capsules only the joints between their links count; these move the outer one.
    """
    link, pieces = arm.capsules.link, arm.capsules.pieces
    reach = inner = _reach(arm, [*np.stack([arm.capsules.a, arm.capsules.b], 1)])
    if pieces is not None:
        inner = _reach(arm, np.split(pieces.corners, pieces.start[1:-1]))
    first, second = link[pairs].T
    outer = np.where(first > second, pairs[:, 0], pairs[:, 1])
    joints = np.arange(arm.joints)
    far = np.maximum(first, second)[:, None]
    between = (joints[None] > np.minimum(first, second)[:, None]) & (joints[None] <= far)
    return reach[outer] * between, inner[outer] * between, reach[guarded[:, 1]]


def travel(arm: Arm) -> Array:
    """Upper bound of the distance [m] between a joint's frame and its parent's, (J,)."""
    slide = np.maximum(np.abs(arm.position_lower), np.abs(arm.position_upper))
    return np.linalg.norm(arm.translation, axis=1) + np.where(arm.prismatic, slide, 0.0)


def _reach(arm: Arm, bodies: list[Array]) -> Array:
    """Largest speed of the corners (V, 3) of each body per unit joint speed [m per rad or m], (C, J).

    A point's distance from a joint's axis is at most that of the next joint's origin, which rotation about
    the axis does not change, plus the lengths from there outwards.
    """
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
