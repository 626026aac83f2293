"""Placeholders in a description: implausible limits and friction, and settings that correct them."""

import math

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.motion.dynamics import RigidBody
from sidegan.robot import Arm
from sidegan.robot.setup import override
from sidegan.validity.pairs import sampled

_FASTEST, _FASTEST_SLIDE = 60.0, 10.0  # [rad/s, m/s] largest plausible velocity limits
_TURN = 2.02 * math.pi  # [rad] largest plausible position limit that several joints share
_FARTHEST = 100.0  # [rad, m] largest plausible position limit
_STRONGEST = 1e5  # [N·m, N] largest plausible torque limit
_SPARE = 20.0  # largest plausible ratio of the weakest joint's limit to the largest holding torque
_WEAK, _UNKNOWN = 100.0, 1000.0  # [N·m] always plausible for the weakest joint; and without masses
_TRIED = 500  # configurations in which holding torques are computed
_MOSTLY = 0.95  # share of these in which sufficient limits hold the arm


def describe_placeholder_limits(arm: Arm) -> str:
    """A sentence on implausible limits, with settings that correct them; empty if there are none."""
    span = np.maximum(np.abs(arm.position_lower), np.abs(arm.position_upper))
    kinds = {
        "position": (span, _far(arm, span)),
        "velocity": (
            arm.velocity_limit,
            arm.velocity_limit > np.where(arm.prismatic, _FASTEST_SLIDE, _FASTEST),
        ),
        "effort": (arm.torque_limit, _strong(arm)),
    }
    wrong, settings = [], []
    for kind, (values, marked) in kinds.items():
        if marked.any():
            wrong.append(f"{kind} of {arm.named(marked)} (up to {float(values[marked].max()):.4g})")
            settings.append(limits_to_state(arm, kind, np.flatnonzero(marked).tolist()))
    if not wrong:
        return ""
    return f"implausible limits: {'; '.join(wrong)}; state the real ones by {' '.join(settings)}"


def describe_weak_limits(arm: Arm) -> str:
    """A sentence on joints whose torque limits hold the arm in only part of its range; empty if none."""
    share = (_held(arm) <= arm.torque_limit).mean(0)
    weak = np.flatnonzero(share < _MOSTLY).tolist()
    if not weak:
        return ""
    limits = arm.torque_limit.tolist()
    names = arm.joint_names
    joints = [f"{names[j]} (effort {limits[j]:.4g}) in {float(share[j]):.0%}" for j in weak]
    return (
        f"torque limits that hold the arm still in only part of its range: {listed(joints)}; if these are "
        f"placeholders, state the real ones by {limits_to_state(arm, 'effort', weak)}"
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


def limits_to_state(arm: Arm, kind: str, joints: list[int]) -> str:
    """The setting of limits for some joints, including those given before."""
    stated = {arm.joint_names[j]: "…" for j in joints}
    return override(f"limits.{kind}", stated, getattr(arm.setup.limits, kind))


def _held(arm: Arm) -> Array:
    """Absolute holding torques [N·m or N], (N, J), in random configurations."""
    q = sampled(arm, _TRIED)
    still = np.zeros_like(q)
    return np.abs(RigidBody(arm).torque(q, still, still))


def _far(arm: Arm, span: Array) -> Array:
    """Joints with implausibly large position limits [rad or m], (J,) bool."""
    alike = (span[:, None] == span[~arm.prismatic]).sum(1) > 1
    return (span > _FARTHEST) | (~arm.prismatic & alike & (span > _TURN))


def _strong(arm: Arm) -> Array:
    """Joints with implausibly large torque limits, (J,) bool."""
    limit = arm.torque_limit
    turns = ~arm.prismatic
    held = _held(arm).max(0)
    none = np.zeros_like(turns)
    if turns.any() and np.isfinite(limit[turns]).all():
        most = max(_SPARE * float(held[turns].max()), _WEAK) if held.any() else _UNKNOWN
        none = turns & (limit[turns].min() >= most)
    return none | (np.isfinite(limit) & (limit > _STRONGEST))
