"""Whether a set of trajectories excites an arm enough to identify it, and what helps if not."""

from dataclasses import replace

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import plain
from sidegan.cell import Cell
from sidegan.design.search import ConditionGoal
from sidegan.identification.goals import TorquePrediction, Uncertain
from sidegan.motion.trajectory import Trajectory
from sidegan.validity.remedies import binding, remedy

# A set that misses one of these excites the arm so little that noise decides over its parameters.
LEAST_USE = 0.3  # median over joints of the share of the limits on motion that they use
MOST_CONDITION = 1e5  # condition number of YᵀY
MOST_UNCERTAINTY = 0.1  # deviation of predicted torques, relative to their usual size


def excitation_warnings(
    cell: Cell, family: Trajectory, c: Array, condition: float, aim: Uncertain | ConditionGoal | None
) -> list[str]:
    """Why a set hardly excites the arm, and what helps; empty for a good set.

    It has coefficients [rad/s], (N, J, H, 2), a condition number of all of them together, and the goal that
    it was designed for, if any.
    """
    use = np.median(replace(cell.problem, trajectory=family).limit_use(c).max(0))
    reasons = []
    if use < LEAST_USE:
        reasons.append(f"it uses {use:.0%} of the limits on motion")
    if not condition <= MOST_CONDITION:
        reasons.append(f"its condition number is {plain(condition)}")
    if isinstance(aim, Uncertain) and isinstance(aim.purpose, TorquePrediction):
        error = np.sqrt(np.square(aim.deviations).mean())
        if not error <= MOST_UNCERTAINTY:
            reasons.append(f"it leaves torques uncertain by {error:.0%} of their usual size")
    if not reasons:
        return []
    text = f"the set hardly excites the arm: {', '.join(reasons)}"
    if where := binding(cell.constraints, family, c):
        text += f"; it is limited by {where[0]} of {where[1]}: try {remedy(cell.constraints, where)}"
    return [text]
