"""Placeholders in a description: implausible limits and friction, and the settings that state others."""

import math
from functools import lru_cache

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.motion.dynamics import RigidBody
from sidegan.robot import Arm
from sidegan.robot.setup import override
from sidegan.validity.pairs import sampled

_FASTEST, _FASTEST_SLIDE = 60.0, 10.0  # [rad/s, m/s] that joints of arms stay below
_TURN = 2.02 * math.pi  # [rad] that no two joints alike go beyond
_FARTHEST = 100.0  # [rad, m] that no joint goes beyond
_STRONGEST = 1e5  # [N·m, N] that joints of arms stay below
_SPARE = 20.0  # times what holding the arm takes at most, that its weakest joint has not
_WEAK, _UNKNOWN = 100.0, 1000.0  # [N·m] that the weakest joint may have; and where nothing has a mass
_TRIED = 500  # configurations in which the arm is held
_MOSTLY = 0.95  # share of them, from which on limits hold it


def describe_placeholder_limits(arm: Arm) -> str:
    """Limits of an arm that no arm has, and the settings that state others; empty where there are none."""
    span = np.maximum(np.abs(arm.position_lower), np.abs(arm.position_upper))
    kinds = {
        "position": (span, _far(arm, span)),
        "velocity": (
            arm.velocity_limit,
            arm.velocity_limit > np.where(arm.prismatic, _FASTEST_SLIDE, _FASTEST),
        ),
        "effort": (arm.torque_limit, _strong(arm)),
    }
    said, settings = [], []
    for kind, (values, marked) in kinds.items():
        if marked.any():
            said.append(f"{kind} of {arm.named(marked)} (up to {float(values[marked].max()):.4g})")
            settings.append(limits_to_state(arm, kind, np.flatnonzero(marked).tolist()))
    if not said:
        return ""
    return f"implausible limits: {'; '.join(said)}; state the real ones by {' '.join(settings)}"


def describe_weak_limits(arm: Arm) -> str:
    """Joints whose torque limits hold the arm in a part of its range alone, and the setting for others."""
    share = (_held(arm) <= arm.torque_limit).mean(0)
    weak = np.flatnonzero(share < _MOSTLY).tolist()
    if not weak:
        return ""
    limits, names = arm.torque_limit.tolist(), arm.joint_names
    said = [f"{names[j]} (effort {limits[j]:.4g}) in {float(share[j]):.0%}" for j in weak]
    return (
        f"torque limits that hold the arm still in only part of its range: {listed(said)}; if these are "
        f"placeholders, state the real ones by {limits_to_state(arm, 'effort', weak)}"
    )


def describe_excessive_friction(arm: Arm) -> str:
    """Joints whose friction alone takes more than their torque limits where they are fastest."""
    drives = arm.known_drives
    beyond = drives.viscous * arm.velocity_limit + drives.coulomb > arm.torque_limit
    if not beyond.any():
        return ""
    return (
        f"at its velocity limit, friction of {arm.named(beyond)} exceeds its torque limit; if this friction "
        "is a placeholder, robot.friction=false leaves it out"
    )


def limits_to_state(arm: Arm, kind: str, joints: list[int]) -> str:
    """The setting that states limits of some joints, beside those that were given before."""
    stated = {arm.joint_names[j]: "…" for j in joints}
    return override(f"limits.{kind}", stated, getattr(arm.setup.limits, kind))


@lru_cache(maxsize=16)
def _held(arm: Arm) -> Array:
    """What holding the arm takes of each joint [N·m or N], (N, J), in random configurations."""
    q = sampled(arm, _TRIED)
    still = np.zeros_like(q)
    return np.abs(RigidBody(arm).torque(q, still, still))


def _far(arm: Arm, span: Array) -> Array:
    """Joints, (J,) bool, that go nowhere near their limits, which are so far from zero [rad or m], (J,)."""
    alike = (span[:, None] == span[~arm.prismatic]).sum(1) > 1
    return (span > _FARTHEST) | (~arm.prismatic & alike & (span > _TURN))


def _strong(arm: Arm) -> Array:
    """Joints, (J,) bool, whose torque limits could hold the arm many times over."""
    limit, turns, held = arm.torque_limit, ~arm.prismatic, _held(arm).max(0)
    none = np.zeros_like(turns)
    if turns.any() and np.isfinite(limit[turns]).all():
        most = max(_SPARE * float(held[turns].max()), _WEAK) if held.any() else _UNKNOWN
        none = turns & (limit[turns].min() >= most)
    return none | (np.isfinite(limit) & (limit > _STRONGEST))
