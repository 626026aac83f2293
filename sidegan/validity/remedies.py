"""Constraints that limit motions, placeholders in a description, and settings that relax or correct them."""

import math
from collections import Counter

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.robot.setup import allowed, override
from sidegan.validity.check import check
from sidegan.validity.constraints import Constraints
from sidegan.validity.pairs import sampled

_LARGER = (1.1, 1.5, 3.0, 10.0, 30.0)  # factors on trajectories, tried until some are invalid
_FASTEST, _FASTEST_SLIDE = 60.0, 10.0  # [rad/s, m/s] largest plausible velocity limits
_TURN = 2.02 * math.pi  # [rad] largest plausible position limit that several joints share
_FARTHEST = 100.0  # [rad, m] largest plausible position limit
_STRONGEST = 1e5  # [N·m, N] largest plausible torque limit
_SPARE = 20.0  # largest plausible ratio of the weakest joint's limit to the largest holding torque
_WEAK, _UNKNOWN = 100.0, 1000.0  # [N·m] always plausible for the weakest joint; and without masses
_TRIED = 500  # configurations in which holding torques are computed
_MOSTLY = 0.95  # share of these in which sufficient limits hold the arm

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
    limit = _limits_to_state(arm, kind, [arm.joint_names.index(which)])
    if constraint == "position":
        return f"{home} or a wider range ({limit})"
    effort = "robot.effort=… or " if constraint in ("velocity", "torque") else ""
    return f"a larger limit ({effort}{limit})"


def describe_placeholder_limits(arm: Arm) -> str:
    """A sentence on implausible limits, with settings that correct them; empty if there are none."""
    turns = ~arm.prismatic
    span = np.maximum(np.abs(arm.position_lower), np.abs(arm.position_upper))
    alike = (span[:, None] == span[turns]).sum(1) > 1
    far = (span > _FARTHEST) | (turns & alike & (span > _TURN))
    fast = arm.velocity_limit > np.where(turns, _FASTEST, _FASTEST_SLIDE)
    kinds = {
        "position": (span, far),
        "velocity": (arm.velocity_limit, fast),
        "effort": (arm.torque_limit, _strong(arm)),
    }
    wrong, settings = [], []
    for kind, (values, marked) in kinds.items():
        if marked.any():
            wrong.append(f"{kind} of {arm.named(marked)} (up to {float(values[marked].max()):.4g})")
            settings.append(_limits_to_state(arm, kind, np.flatnonzero(marked).tolist()))
    if not wrong:
        return ""
    return f"implausible limits: {'; '.join(wrong)}; state the real ones by {' '.join(settings)}"


def describe_weak_limits(arm: Arm) -> str:
    """A sentence on joints whose torque limits hold the arm in only part of its range; empty if none."""
    share = (_held(arm) <= arm.torque_limit).mean(0)
    weak = np.flatnonzero(share < _MOSTLY).tolist()
    if not weak:
        return ""
    limits, names = arm.torque_limit.tolist(), arm.joint_names
    joints = [f"{names[j]} (effort {limits[j]:.4g}) in {float(share[j]):.0%}" for j in weak]
    return (
        f"torque limits that hold the arm still in only part of its range: {listed(joints)}; if these are "
        f"placeholders, state the real ones by {_limits_to_state(arm, 'effort', weak)}"
    )


def describe_excessive_friction(arm: Arm) -> str:
    """A sentence on joints whose friction at the velocity limit exceeds the torque limit; empty if none."""
    drives = arm.known_drives
    beyond = drives.viscous * arm.velocity_limit + drives.coulomb > arm.torque_limit
    if not beyond.any():
        return ""
    return (
        f"at its velocity limit, friction of {arm.named(beyond)} exceeds its torque limit; if this friction "
        "is a placeholder, robot.friction=false leaves it out"
    )


def _limits_to_state(arm: Arm, kind: str, joints: list[int]) -> str:
    """The setting of limits for some joints, including those given before."""
    stated = {arm.joint_names[j]: "…" for j in joints}
    return override(f"limits.{kind}", stated, getattr(arm.setup.limits, kind))


def _held(arm: Arm) -> Array:
    """Absolute holding torques [N·m or N], (N, J), in random configurations."""
    q = sampled(arm, _TRIED)
    return np.abs(RigidBody(arm).torque(q, 0 * q, 0 * q))


def _strong(arm: Arm) -> Array:
    """Joints with implausibly large torque limits, (J,) bool."""
    limit, turns = arm.torque_limit, ~arm.prismatic
    held = _held(arm).max(0)
    strong = np.isfinite(limit) & (limit > _STRONGEST)
    if turns.any() and np.isfinite(limit[turns]).all():
        most = max(_SPARE * float(held[turns].max()), _WEAK) if held.any() else _UNKNOWN
        strong |= turns & (limit[turns].min() >= most)
    return strong
