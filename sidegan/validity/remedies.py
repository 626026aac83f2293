"""Constraints that limit motions, placeholders in a description, and settings that relax or correct them."""

from collections import Counter
from typing import Any

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.base.settings_text import FILL_IN, suggest_limits, suggest_touching, suggestion
from sidegan.errors import RobotError
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.robot.consistency import describe_other_units
from sidegan.robot.sources import read_source
from sidegan.robot.thresholds import FULL_TURN, LIMITS
from sidegan.robot.units import reductions_of
from sidegan.validity.check import check
from sidegan.validity.constraints import Constraints
from sidegan.validity.pairs import random_configurations
from sidegan.validity.thresholds import (
    COINCIDENCE,
    FAST_JOINT,
    FASTEST_TIP,
    GEARED,
    LEG_JOINTS,
    MOSTLY_HELD,
    PLAUSIBLE_TORQUE,
    PLAUSIBLE_UNKNOWN,
    SPARE_TORQUE,
)

_LARGER = (1.1, 1.5, 3.0, 10.0, 30.0)  # factors on trajectories, tried until some are invalid
_TRIED = 500  # configurations in which holding torques are computed
# What implausible limits may be, by kind; each kind has the causes of those before it, too.
_DOUBTS = {
    "position": "placeholders",
    "velocity": "the motors', or placeholders",
    "effort": "the motors', in mN·m or mN, or placeholders",
}

Violation = tuple[str, str]  # a constraint, and its joint, pair or region


def binding(constraints: Constraints, trajectory: Trajectory, c: Array) -> Violation | None:
    """The constraint that most trajectories, coefficients [rad/s], (B, J, H, 2), violate first when enlarged.

    None if they do not violate any.
    """
    for factor in _LARGER:
        found = check(constraints, trajectory, factor * c)
        invalid = np.flatnonzero(~found.valid).tolist()
        faults = Counter((x.constraint, x.where) for k in invalid for x in found.failures(k))
        if faults:
            return faults.most_common(1)[0][0]
    return None


def remedy(constraints: Constraints, where: Violation) -> str:
    """Settings that relax a constraint, in words for people."""
    constraint, which = where
    arm = constraints.arm
    home = f"another home ({suggestion('trajectory.home', [FILL_IN])})"
    closer = suggestion("workspace.clearance", FILL_IN)
    if constraint == "collision":
        pair = which.split(" – ")
        gap = constraints.tight.get((pair[0], pair[1]), constraints.apart)
        nearer = f"a clearance below {gap:g} m ({closer}), " if gap else ""
        touch = suggest_touching([pair], arm.setup.may_touch)
        return f"{nearer}{home} or, if contact is expected, {touch}"
    if constraint == "keep_out":
        nearer = f"a smaller clearance ({closer}), " if constraints.clearance else ""
        return f"{nearer}{home} or no regions ({suggestion('workspace', 'free')})"
    j = arm.joint_names.index(which)
    kind = "effort" if constraint == "torque" else constraint
    mine = which in _given(arm, kind)  # and not the description's
    own = f" or a wider limit than yours ({_limits_to_state(arm, kind, [j])})" if mine else ""
    share = ""
    if constraint in ("velocity", "torque"):
        share = f", more of the limits ({suggestion('robot.effort', FILL_IN)}, up to 1)"
    if constraint == "torque":
        return f"masses that are right ({_masses(arm)}), {home}{share}{own}{_made_up(arm, [j])}"
    slower = f", slower motion ({suggestion('trajectory.period', FILL_IN)})"
    return f"{home}{slower if constraint != 'position' else ''}{share}{own}"


def refuse_other_units(arm: Arm) -> None:
    """Refuse masses, inertias and torque limits that no arm has, by a RobotError that asks what they are."""
    doubt = describe_other_units(arm)
    weak = np.flatnonzero(_held(arm).max(0) > GEARED * arm.torque_limit).tolist()
    if doubt or (weak and _geared(arm, weak)):
        raise RobotError(
            f"{doubt or describe_weak_limits(arm)}; correct the file, or leave torques unchecked by "
            f"{suggestion('workspace.torque', False)}"
        )


def describe_placeholder_limits(arm: Arm) -> str:
    """A sentence on implausible limits, with settings that correct them; empty if there are none."""
    turns = ~arm.prismatic
    span = np.maximum(np.abs(arm.position_lower), np.abs(arm.position_upper))
    alike = (span[:, None] == span[turns]).sum(1) > 1
    most = {
        kind: np.where(turns, turning.value, sliding.value) for kind, (turning, sliding) in LIMITS.items()
    }
    kinds = {
        "position": (span, (span > most["position"]) | (turns & alike & (span > FULL_TURN))),
        "velocity": (arm.velocity_limit, (arm.velocity_limit > most["velocity"]) | _motors(arm)),
        "effort": (arm.torque_limit, _strong(arm, most["effort"])),
    }
    wrong: list[str] = []
    stated: dict[str, dict[str, Any]] = {}
    for kind, (values, marked) in kinds.items():
        if marked.any():
            wrong.append(f"{kind} of {arm.named(marked)} (up to {float(values[marked].max()):.4g})")
            stated[kind] = {arm.joint_names[j]: FILL_IN for j in np.flatnonzero(marked).tolist()}
    if not wrong:
        return ""
    last = [*stated][-1]
    return (
        f"implausible limits: {'; '.join(wrong)}; are they {_DOUBTS[last]}? The arm may not follow; "
        f"state the real ones by {suggest_limits(stated, vars(arm.setup.limits))}"
    )


def _motors(arm: Arm) -> Array:
    """Joints whose described velocities, too fast at the tip, are probably the motors', (J,) bool.

    Not of legs, which are as fast.
    """
    reach = np.linalg.norm([*arm.translation[1:], arm.tip], axis=1)[::-1].cumsum()[::-1]  # to the tip
    given = [name in _given(arm, "velocity") for name in arm.joint_names]
    fast = ~arm.prismatic & (arm.velocity_limit > FAST_JOINT) & ~np.array(given)
    quick = float((arm.velocity_limit * reach * fast).max()) > FASTEST_TIP
    return fast & quick & (arm.joints > LEG_JOINTS) & (2 * fast.sum() >= (~arm.prismatic).sum())


def describe_weak_limits(arm: Arm) -> str:
    """A sentence on joints whose torque limits hold the arm in only part of its range; empty if none."""
    share = (_held(arm) <= arm.torque_limit).mean(0)
    weak = np.flatnonzero(share < MOSTLY_HELD).tolist()
    if not weak:
        return ""
    limits, names = arm.torque_limit.tolist(), arm.joint_names
    joints = [f"{names[j]} (effort {limits[j]:.4g}) in {float(share[j]):.0%}" for j in weak]
    return (
        f"torque limits that hold the arm still in only part of its range: {listed(joints)}; first check "
        f"the masses ({_masses(arm)}){_geared(arm, weak) or _made_up(arm, weak)}"
    )


def _geared(arm: Arm, weak: list[int]) -> str:
    """A question whether torque limits are the motors', if the file has the gears of the weak joints."""
    gears = reductions_of(read_source(arm.urdf, arm.setup.args).root)
    limits = dict(zip(arm.joint_names, arm.torque_limit.tolist()))
    joint = {name: gears[name] * x for name, x in limits.items() if name in gears}
    names = {arm.joint_names[j] for j in weak}
    if not names <= {*joint} or names & {*_given(arm, "effort")}:
        return ""
    right = suggest_limits({"effort": joint | _given(arm, "effort")}, vars(arm.setup.limits))
    return f"; are these limits the motors'? Times the mechanicalReduction in the file they are {right}"


def _masses(arm: Arm) -> str:
    """Words on the mass of the arm and of its heaviest link, which may be wrong rather than a limit."""
    mass = arm.inertial_parameters[:, 0]
    return f"{mass.sum():.3g} kg together, {arm.link_names[int(mass.argmax())]} {mass.max():.3g} kg"


def _made_up(arm: Arm, joints: list[int]) -> str:
    """Words on real torque limits, if those described are one number for all joints, or else empty."""
    if arm.joints < COINCIDENCE or (arm.torque_limit != arm.torque_limit[0]).any():
        return ""
    stated = _limits_to_state(arm, "effort", joints)
    return f"; if the same limit for all joints is a placeholder, state the real ones by {stated}"


def describe_excessive_friction(arm: Arm) -> str:
    """A sentence on joints whose friction at the velocity limit exceeds the torque limit; empty if none."""
    drives = arm.known_drives
    beyond = drives.viscous * arm.velocity_limit + drives.coulomb > arm.torque_limit
    if not beyond.any():
        return ""
    return (
        f"friction of {arm.named(beyond)} at the velocity limit exceeds the torque limit; if this friction "
        f"is a placeholder, {suggestion('robot.friction', False)} leaves it out"
    )


def _limits_to_state(arm: Arm, kind: str, joints: list[int]) -> str:
    """The setting of limits for some joints, including those given before."""
    stated = {arm.joint_names[j]: FILL_IN for j in joints}
    return suggest_limits({kind: stated}, vars(arm.setup.limits))


def _given(arm: Arm, kind: str) -> dict[str, Any]:
    """The user's limits by joint."""
    return getattr(arm.setup.limits, kind) or {}


def _held(arm: Arm) -> Array:
    """Absolute torques that hold the arm still [N·m or N], (N, J), in random configurations."""
    q = random_configurations(arm, _TRIED)
    return np.abs(RigidBody(arm).torque(q, 0 * q, 0 * q))


def _strong(arm: Arm, largest: Array) -> Array:
    """Joints with implausible torque limits, (J,) bool: above the largest, or all far beyond use."""
    limit, turns = arm.torque_limit, ~arm.prismatic
    held = _held(arm).max(0)
    strong = np.isfinite(limit) & (limit > largest)
    if turns.any() and np.isfinite(limit[turns]).all():
        known = max(SPARE_TORQUE * float(held[turns].max()), PLAUSIBLE_TORQUE)
        most = known if held.any() else PLAUSIBLE_UNKNOWN
        strong |= turns & (limit[turns].min() >= most)
    return strong
