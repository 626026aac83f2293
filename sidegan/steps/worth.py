"""Whether a set of trajectories is worth executing, and what stands in its way where it is not."""

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import plain
from sidegan.cell import Cell
from sidegan.design.search import ConditionGoal
from sidegan.identification.goals import Prediction
from sidegan.identification.uncertain import Uncertain
from sidegan.validity.remedies import binding, remedy

_LITTLE = 0.3  # share of its limits on motion that half of the joints exceed in a good set
_CONDITION = 1e5  # of a good set at most
_UNCERTAIN = 0.1  # share of their usual size by which torques are uncertain after a good set at most


def describe_weak_set(cell: Cell, aim: Uncertain | ConditionGoal | None, c: Array, condition: float) -> str:
    """Why a set [rad/s], (N, J, H, 2), of this condition tells little, and what helps; or nothing."""
    use, said = np.median(cell.problem.limit_use(c).max(0)), list[str]()
    if use < _LITTLE:
        said.append(f"it uses {use:.0%} of the limits on motion")
    if not condition <= _CONDITION:
        said.append(f"its condition is {plain(condition)}")
    if isinstance(aim, Uncertain) and isinstance(aim.purpose, Prediction):
        left = np.sqrt(np.square(aim.deviations).mean())
        if not left <= _UNCERTAIN:
            said.append(f"it leaves torques uncertain by {left:.0%} of their usual size")
    if not said:
        return ""
    where = binding(cell.constraints, cell.trajectory, c)
    if where is None:
        return f"the set excites the arm little: {', '.join(said)}"
    constraint, which = where
    return (
        f"the set excites the arm little: {', '.join(said)}; what limits it is {constraint} of {which}: "
        f"{remedy(cell.constraints, where)}"
    )
