"""What stands in the way of motions, and the settings that take it out of the way."""

from collections import Counter

import numpy as np

from sidegan.base.arrays import Array
from sidegan.motion.trajectory import Trajectory
from sidegan.robot.setup import allowed
from sidegan.validity.check import check
from sidegan.validity.constraints import Constraints
from sidegan.validity.placeholders import limits_to_state

_LARGER = (1.1, 1.5, 3.0, 10.0, 30.0)  # times a trajectory's size, until some are invalid

Where = tuple[str, str]  # a constraint, and its joint, pair or region


def binding(constraints: Constraints, trajectory: Trajectory, c: Array) -> Where | None:
    """What most trajectories with coefficients [rad/s], (B, J, H, 2), violate first where they are larger.

    None where nothing holds them back.
    """
    for times in _LARGER:
        found = check(constraints, trajectory, times * c)
        each = [found.failures(k) for k in np.flatnonzero(~found.valid).tolist()]
        faults = Counter((failure.constraint, failure.where) for failures in each for failure in failures)
        if faults:
            return faults.most_common(1)[0][0]
    return None


def remedy(constraints: Constraints, where: Where) -> str:
    """Settings by which a constraint no longer stands in the way, for people."""
    (constraint, which), arm = where, constraints.arm
    home = "another home ('trajectory.home=[…]')"
    if constraint == "collision":
        pair = which.split(" – ")
        gap = constraints.tight.get((pair[0], pair[1]), constraints.apart)
        nearer = f"a clearance below {gap:g} m (workspace.clearance=…), " if gap else ""
        touch = allowed([pair], arm.setup.may_touch)
        return f"{nearer}{home} or, if contact is expected, {touch}"
    if constraint == "keep_out":
        nearer = "a smaller clearance (workspace.clearance=…), " if constraints.clearance else ""
        return f"{nearer}{home} or no regions (workspace=free)"
    kind = "effort" if constraint == "torque" else constraint
    limit = limits_to_state(arm, kind, [arm.joint_names.index(which)])
    if constraint == "position":
        return f"{home} or a wider range ({limit})"
    more = "robot.effort=… or " if constraint in ("velocity", "torque") else ""
    return f"a larger limit ({more}{limit})"
