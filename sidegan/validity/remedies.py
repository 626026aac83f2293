"""Constraints that limit motions, and settings that relax them."""

from collections import Counter

import numpy as np

from sidegan.base.arrays import Array
from sidegan.motion.trajectory import Trajectory
from sidegan.robot.setup import allowed
from sidegan.validity.check import check
from sidegan.validity.constraints import Constraints
from sidegan.validity.placeholders import limits_to_state

_LARGER = (1.1, 1.5, 3.0, 10.0, 30.0)  # factors on trajectories, tried until some are invalid

Where = tuple[str, str]  # a constraint, and its joint, pair or region


def binding(constraints: Constraints, trajectory: Trajectory, c: Array) -> Where | None:
    """The constraint that most trajectories, coefficients [rad/s], (B, J, H, 2), violate first when enlarged.

    None if they do not violate any.
    """
    for times in _LARGER:
        found = check(constraints, trajectory, times * c)
        invalid = np.flatnonzero(~found.valid).tolist()
        faults = Counter((x.constraint, x.where) for k in invalid for x in found.failures(k))
        if faults:
            return faults.most_common(1)[0][0]
    return None


def remedy(constraints: Constraints, where: Where) -> str:
    """Settings that relax a constraint, in words for people."""
    constraint, which = where
    arm = constraints.arm
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
    effort = "robot.effort=… or " if constraint in ("velocity", "torque") else ""
    return f"a larger limit ({effort}{limit})"
