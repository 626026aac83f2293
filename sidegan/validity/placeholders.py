"""Placeholders in a description: implausible limits."""

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
    """Limits of an arm that no arm has, and the words that state others; empty where there are none."""
    held, enough = _held(arm).max(0), enough_effort(arm)
    units = [("m", "N") if slides else ("rad", "N·m") for slides in arm.prismatic.tolist()]
    span = np.maximum(np.abs(arm.position_lower), np.abs(arm.position_upper))
    speed = np.where(arm.prismatic, _FASTEST_SLIDE, _FASTEST)
    kinds = {
        "position": (span, _far(arm, span), [f"±{{}} {length}" for length, _ in units]),
        "velocity": (arm.velocity_limit, arm.velocity_limit > speed, [f"{{}} {x}/s" for x, _ in units]),
        "effort": (arm.torque_limit, _strong(arm, held), [f"{{}} {force}" for _, force in units]),
    }
    said, settings = [], []
    for kind, (values, marked, forms) in kinds.items():
        which = np.flatnonzero(marked).tolist()
        by_value: dict[str, list[str]] = {}
        for j in which:
            by_value.setdefault(forms[j].format(f"{float(values[j]):.4g}"), []).append(arm.joint_names[j])
        said += [f"{kind} {value} of {listed(names)}" for value, names in by_value.items()]
        examples = {
            arm.joint_names[j]: _example(kind, bool(arm.prismatic[j]), float(enough[j])) for j in which
        }
        settings += [override(f"limits.{kind}", examples, getattr(arm.setup.limits, kind))] if which else []
    if not said:
        return ""
    return f"implausible limits: {'; '.join(said)}; state the arm's own, for example {' '.join(settings)}"


def describe_weak_limits(arm: Arm) -> str:
    """Joints whose torque limits hold the arm in a part of its range alone, and words that state others."""
    share = (_held(arm) <= arm.torque_limit).mean(0)
    weak = np.flatnonzero(share < _MOSTLY).tolist()
    if not weak:
        return ""
    names, enough = arm.joint_names, enough_effort(arm)
    said = [f"{names[j]} (effort {float(arm.torque_limit[j]):.4g}) in {float(share[j]):.0%}" for j in weak]
    examples = {names[j]: float(f"{float(enough[j]):.2g}") for j in weak}
    return (
        f"limits that do not hold the arm still in all of its range: {listed(said)}; if they are not its "
        f"own, state these, for example {override('limits.effort', examples, arm.setup.limits.effort)}"
    )


def describe_excessive_friction(arm: Arm) -> str:
    """Joints whose friction alone takes more than their torque limits where they are fastest."""
    drives = arm.known_drives
    beyond = drives.viscous * arm.velocity_limit + drives.coulomb > arm.torque_limit
    if not beyond.any():
        return ""
    return (
        f"at its velocity limit the friction of {arm.named(beyond)} takes more than its torque limit; if it "
        "is a placeholder, robot.friction=false leaves it out"
    )


def enough_effort(arm: Arm) -> Array:
    """Torques [N·m or N], (J,), that an arm may have: twice what holding it takes at most, or more."""
    held = _held(arm).max(0)
    return np.maximum(np.maximum(2 * held, 0.4 * float(held.max())), 1.0)


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


def _strong(arm: Arm, held: Array) -> Array:
    """Joints, (J,) bool, whose limits could hold the arm many times over, which takes so much, (J,)."""
    limit, turns = arm.torque_limit, ~arm.prismatic
    none = np.zeros_like(turns)
    if turns.any() and np.isfinite(limit[turns]).all():
        most = max(_SPARE * float(held[turns].max()), _WEAK) if held.any() else _UNKNOWN
        none = turns & (limit[turns].min() >= most)
    return none | (np.isfinite(limit) & (limit > _STRONGEST))


def _example(kind: str, slides: bool, effort: float) -> float | tuple[float, float]:
    """A limit that an arm may have, of a joint that so much effort is enough for [N·m or N]."""
    if kind == "position":
        return (-0.5, 0.5) if slides else (-3.14, 3.14)
    if kind == "velocity":
        return 0.1 if slides else 1.0
    return float(f"{effort:.2g}")
