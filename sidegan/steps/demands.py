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
_RATES = {"velocity": (1, "/s"), "acceleration": (2, "/s²"), "jerk": (3, "/s³")}  # order and unit
_UNLIMITED = np.array(np.inf)


def energy_of(cell: Cell, motion: Motion) -> Array:
    """Mechanical work of the joints, whether they drive or brake [J], (N,)."""
    power = np.abs(cell.body.drive_torque(*motion[1:]) * motion.velocity).sum(2)
    return np.trapezoid(power, motion.time, axis=1)


def demands_of(cell: Cell, family: Trajectory, c: Array, conditions: Array, rate: float) -> pd.DataFrame:
    """Demands of each trajectory as text: peaks at a rate [Hz], clearance and energy.

    Trajectories have coefficients [rad/s], (N, J, H, 2), and condition numbers, (N,).
    """
    arm = cell.whole_arm
    times = family.times(rate)
    motion = family.roll_out(c, times)
    q = family.derivative(c, family.times(_DISTANCE_RATE), 0)
    nearest = cell.constraints.nearest(q.reshape(-1, arm.joints))[0].reshape(len(q), -1).min(1)
    known = bool(arm.inertial_parameters.any()) and not placeholder_links(arm)
    limits = {"velocity": arm.velocity_limit, **arm.higher_limits}
    columns: dict[str, list[str] | str] = {"cond(YᵀY)": [plain(x) for x in conditions.tolist()]}
    for name, (order, per) in _RATES.items():
        units = [f"{'m' if slides else 'rad'}{per}" for slides in arm.prismatic]
        columns[f"peak {name}"] = _peaks(
            family.derivative(c, times, order), limits.get(name, _UNLIMITED), units
        )
    units = ["N" if slides else "N·m" for slides in arm.prismatic]
    torque = cell.body.drive_torque(*motion[1:])
    columns["peak torque"] = _peaks(torque, arm.torque_limit, units) if known else "—"
    columns["clearance [m]"] = [f"{x:.3f}" if isfinite(x) else "—" for x in nearest.tolist()]
    columns["energy [J]"] = [plain(x) for x in energy_of(cell, motion).tolist()] if known else "—"
    return pd.DataFrame(columns, pd.RangeIndex(1, len(c) + 1, name="trajectory"))


def _peaks(x: Array, limit: Array, units: list[str]) -> list[str]:
    """Largest value over joints (N, T, J), relative to limits (J,), as text with share and unit, (N,)."""
    most = np.abs(x).max(1)
    limited = np.isfinite(limit).any()
    share = most / limit if limited else most
    values = [f"{plain(row[j])} {units[j]}" for row, j in zip(most, share.argmax(1))]
    return [f"{used:.0%}, {value}" for used, value in zip(share.max(1), values)] if limited else values
