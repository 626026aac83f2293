"""How much a margin can change between a sample and the edge of its cell: rigorous upper bounds.

From a sample's velocity and acceleration and a bound on the jerk follow bounds on the joints' motion in the
cell; from those, bounds on the motion of capsules and on how torques change, by triangle inequalities
alone (``sidegan.motion.compiled.formulas``). How far accelerations and jerks drift, where they
are limited, follows from the next derivative at the sample and a bound on the one after.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from sidegan.motion.compiled.formulas import (
    Bounds,
    MotionBounds,
    WrenchBounds,
    carried_bounds,
    cell_bounds,
    drift,
    link_bounds,
    summed,
    wrench_bounds,
)
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm

if TYPE_CHECKING:
    from sidegan.validity.constraints import Constraints

_SAMPLES_AT_ONCE = 200_000  # of the jerk: 11 MB for seven joints


@dataclass(frozen=True)
class CellMotion:
    """Bounds over a cell, (N, J) each: largest change of position and velocity, largest rates."""

    position_change: Tensor
    velocity_change: Tensor
    speed: Tensor
    acceleration: Tensor
    jerk: Tensor
    snap: Tensor


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


def cell_motion(dq: Tensor, ddq: Tensor, jerk: Tensor, snap: Tensor, half: float) -> CellMotion:
    """Bounds over cells of half width ``half`` [s] around samples (N, J), by Taylor's theorem.

    Jerk and snap are bounds already.
    """
    return CellMotion(*cell_bounds(dq, ddq, jerk, half), jerk, snap)


class Slack:
    """Largest change of every margin of ``constraints`` within a cell."""

    def __init__(self, constraints: "Constraints") -> None:
        self.arm = constraints.arm
        self.torque = constraints.torque
        link = self.arm.capsules.link
        reach = capsule_reach(self.arm)
        # Between two capsules only the joints between their links count, and they carry the outer one.
        first, second = link[constraints.pairs].unbind(1)
        outer = torch.where(first > second, constraints.pairs[:, 0], constraints.pairs[:, 1])
        joints = torch.arange(self.arm.joints)
        far = torch.maximum(first, second)[:, None]
        self.between = (joints[None] > torch.minimum(first, second)[:, None]) & (joints[None] <= far)
        self.pair_reach = reach[outer] * self.between
        self.piece_reach = piece_reach(self.arm)[outer] * self.between
        self.region_reach = reach[constraints.guarded[:, 1]]

    def of(self, motion: CellMotion, half: float, rate: Tensor | None = None) -> dict[str, Tensor]:
        """Upper bounds of the change of each margin in the cell, shaped like the margins.

        The torques' rates at the centre, (N, J), make theirs of second order where they are known.
        """
        slack = {"position": motion.position_change, "velocity": motion.velocity_change}
        if self.torque:
            most, bend = torque_bounds(self.arm, motion)
            known = half * most
            slack["torque"] = known if rate is None else torch.minimum(known, drift(rate, bend, half))
        slack["collision"] = motion.position_change @ self.pair_reach.to(motion.jerk).T
        slack["keep_out"] = motion.position_change @ self.region_reach.to(motion.jerk).T
        return slack


def _travel(arm: Arm) -> Tensor:
    """Upper bound of the distance [m] between a joint's frame and its parent's, (J,)."""
    slide = torch.maximum(arm.position_lower.abs(), arm.position_upper.abs())
    return arm.translation.norm(dim=1) + torch.where(arm.prismatic, slide, torch.zeros_like(slide))


def capsule_reach(arm: Arm) -> Tensor:
    """Largest speed [m per rad or m] that unit speed of a joint gives a point of a capsule's axis, (C, J).

    The distance of a point to a joint's axis is at most that of the next joint's origin (which turning
    about the axis does not change) plus the lengths from there outwards.
    """
    capsules = arm.capsules
    points = torch.stack([capsules.a, capsules.b], 1)
    return _reach(arm, capsules.link.tolist(), [*points])


def piece_reach(arm: Arm) -> Tensor:
    """The same of a point of the hull inside of each capsule, (C, J)."""
    pieces = arm.capsules.pieces
    if pieces is None:
        return capsule_reach(arm)
    return _reach(arm, arm.capsules.link.tolist(), [*pieces.corners.split(pieces.start.diff().tolist())])


def _reach(arm: Arm, links: list[int], bodies: list[Tensor]) -> Tensor:
    """Largest speed [m per rad or m] that a joint gives the corners (V, 3) of bodies on links, (C, J)."""
    travel = _travel(arm)
    reach = torch.zeros(len(links), arm.joints, dtype=torch.float64)
    for k, (link, corners) in enumerate(zip(links, bodies)):
        for j in range(link + 1):
            if arm.prismatic[j]:
                reach[k, j] = 1.0
            elif j == link:
                reach[k, j] = _from_axis(arm, j, corners).max()
            else:
                step = travel[j + 1] if arm.prismatic[j + 1] else _from_axis(arm, j, arm.translation[j + 1])
                reach[k, j] = step + travel[j + 2 : link + 1].sum() + corners.norm(dim=1).max()
    return reach


def _from_axis(arm: Arm, joint: int, points: Tensor) -> Tensor:
    """Distance [m] of points (…, 3) from a joint's axis, (…)."""
    return torch.linalg.cross(arm.axis[joint].expand_as(points), points).norm(dim=-1)


def torque_bounds(arm: Arm, motion: CellMotion) -> tuple[Tensor, Tensor]:
    """Upper bounds of every joint torque's absolute rate and second derivative in a cell, (N, J) each."""
    travel, mass, first, spin = link_norms(arm).values()
    slides, zero = arm.prismatic.tolist(), torch.zeros_like(motion.speed[:, 0])
    still: Bounds = (zero, zero, zero)
    rates = motion.speed, motion.acceleration, motion.jerk, motion.snap
    own = list(zip(*(x.unbind(1) for x in rates)))
    link: MotionBounds = (still, still, (zero + arm.gravity.norm().to(zero), zero, zero))
    wrenches = []
    for i in range(arm.joints):
        link = link_bounds(slides[i], own[i], travel[i], link)
        wrenches.append(wrench_bounds(mass[i], first[i], spin[i], link))
    carried: WrenchBounds = (still, still)
    found = []
    for i in reversed(range(arm.joints)):
        force, moment = (summed(a, b) for a, b in zip(carried, wrenches[i]))
        found.append(torch.stack((force if slides[i] else moment)[1:]))
        carried = carried_bounds(slides[i], own[i], travel[i], (force, moment))
    rate, bend = torch.stack(found[::-1], 2)
    return rate, bend


def link_norms(arm: Arm) -> dict[str, Tensor]:
    """Norms that bound torques, (J,) each: way to the next frame, mass, first and second moments of mass."""
    return {
        "travel": _travel(arm),
        "mass": arm.inertial_parameters[:, 0].abs(),
        "first": arm.inertial_parameters[:, 1:4].norm(dim=1),
        "spin": torch.linalg.matrix_norm(_inertia_matrices(arm), ord=2),
    }


def _inertia_matrices(arm: Arm) -> Tensor:
    xx, xy, yy, xz, yz, zz = arm.inertial_parameters[:, 4:].unbind(1)
    return torch.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], 1).reshape(-1, 3, 3)
