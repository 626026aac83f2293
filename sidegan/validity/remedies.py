"""Settings that relax a constraint, and those that correct implausible limits of a description."""

import math

import numpy as np

from sidegan.base.arrays import Array
from sidegan.motion.dynamics import RigidBody
from sidegan.robot import Arm
from sidegan.robot.setup import allowed, override
from sidegan.validity.constraints import Constraints
from sidegan.validity.pairs import sampled

_FASTEST, _FASTEST_SLIDE = 60.0, 10.0  # [rad/s, m/s] largest plausible velocity limits
_TURN = 2.02 * math.pi  # [rad] largest plausible position limit that several joints share
_FARTHEST = 100.0  # [rad, m] largest plausible position limit
_STRONGEST = 1e5  # [N·m, N] largest plausible torque limit
_SPARE = 20.0  # largest plausible ratio of the weakest joint's limit to the largest holding torque
_WEAK, _UNKNOWN = 100.0, 1000.0  # [N·m] always plausible for the weakest joint; and without masses
_TRIED = 500  # configurations in which holding torques are computed


def remedy(constraints: Constraints, where: tuple[str, str]) -> str:
    """Settings that relax a constraint of a joint, pair or region, in words for people."""
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


def _limits_to_state(arm: Arm, kind: str, joints: list[int]) -> str:
    """The setting of limits for some joints, including those given before."""
    stated = {arm.joint_names[j]: "…" for j in joints}
    return override(f"limits.{kind}", stated, getattr(arm.setup.limits, kind))


def _strong(arm: Arm) -> Array:
    """Joints with implausibly large torque limits, (J,) bool."""
    limit, turns = arm.torque_limit, ~arm.prismatic
    q = sampled(arm, _TRIED)
    held = np.abs(RigidBody(arm).torque(q, 0 * q, 0 * q)).max(0)
    strong = np.isfinite(limit) & (limit > _STRONGEST)
    if turns.any() and np.isfinite(limit[turns]).all():
        most = max(_SPARE * float(held[turns].max()), _WEAK) if held.any() else _UNKNOWN
        strong |= turns & (limit[turns].min() >= most)
    return strong
