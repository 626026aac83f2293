"""What trajectories demand of an arm: peaks of motion and torque, clearance, energy."""

from math import isfinite

import numpy as np
import pandas as pd

from sidegan.base.arrays import Array
from sidegan.base.names import plain
from sidegan.cell import Cell
from sidegan.motion.trajectory import Motion, Trajectory
from sidegan.robot import placeholder_links

_DISTANCE_RATE = 25.0  # [Hz] at which distances are computed
# order of each derivative, and what follows rad or m in its unit
_DERIVATIVES = {"velocity": (1, "/s"), "acceleration": (2, "/s²"), "jerk": (3, "/s³")}
_UNKNOWN = "—"


def energy_of(cell: Cell, motion: Motion) -> Array:
    """Integral of Σ |τ q̇| [J], (N,): braking counts like driving."""
    power = np.abs(cell.body.drive_torque(*motion[1:]) * motion.velocity).sum(2)
    return np.trapezoid(power, motion.time, axis=1)


def demands_of(cell: Cell, family: Trajectory, c: Array, conditions: Array, rate: float) -> pd.DataFrame:
    """Demands of each trajectory as text, a row each: cond(YᵀY), peaks, clearance and energy.

    Trajectories have coefficients [rad/s], (N, J, H, 2), and condition numbers, (N,). Peaks are of samples at
    a rate [Hz], and relative to the limits before the effort reduces them. Torque and energy are "—" without
    masses. Clearance is sampled, and may be less between samples: validity is proven elsewhere.
    """
    arm = cell.whole_arm
    times = family.times(rate)
    motion = family.roll_out(c, times)
    q = family.derivative(c, family.times(_DISTANCE_RATE), 0)
    nearest = cell.constraints.nearest(q.reshape(-1, arm.joints))[0].reshape(len(q), -1).min(1)
    masses_known = bool(arm.inertial_parameters.any()) and not placeholder_links(arm)
    limits = {"velocity": arm.velocity_limit, **arm.higher_limits}
    columns: dict[str, list[str] | str] = {"cond(YᵀY)": [plain(x) for x in conditions.tolist()]}
    for name, (order, per) in _DERIVATIVES.items():
        units = [f"{'m' if slides else 'rad'}{per}" for slides in arm.prismatic]
        columns[f"peak {name}"] = _peaks(family.derivative(c, times, order), limits.get(name), units)
    units = ["N" if slides else "N·m" for slides in arm.prismatic]
    torque = cell.body.drive_torque(*motion[1:])
    columns["peak torque"] = _peaks(torque, arm.torque_limit, units) if masses_known else _UNKNOWN
    columns["clearance [m]"] = [f"{x:.3f}" if isfinite(x) else "none near" for x in nearest.tolist()]
    columns["energy [J]"] = [plain(x) for x in energy_of(cell, motion).tolist()] if masses_known else _UNKNOWN
    return pd.DataFrame(columns, pd.RangeIndex(1, len(c) + 1, name="trajectory"))


def _peaks(signal: Array, limit: Array | None, units: list[str]) -> list[str]:
    """Texts (N,), such as "83%, 1.2 rad/s": each trajectory's peak at the joint nearest to its limit.

    ``signal`` is (N, T, J), ``limit`` (J,), each in the joint's unit. Without limits, the largest by unit.
    """
    most = np.abs(signal).max(1)
    if limit is None or not np.isfinite(limit).any():
        joints = {unit: [own == unit for own in units] for unit in units}
        return [", ".join(f"{plain(row[of].max())} {unit}" for unit, of in joints.items()) for row in most]
    share = most / limit
    worst = zip(share, most, share.argmax(1))
    return [f"{used[j]:.0%}, {plain(row[j])} {units[j]}" for used, row, j in worst]
