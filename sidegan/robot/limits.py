"""Limits of the moving joints: the user's, or else the description's."""

import logging
import math
import xml.etree.ElementTree as ET
from collections.abc import Callable
from functools import partial
from itertools import product
from typing import Any, TypeVar

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.base.settings_text import FILL_IN, setting_name, suggest_limits
from sidegan.errors import RobotError
from sidegan.robot import xml
from sidegan.robot.arm import DERIVATIVE_ORDER
from sidegan.robot.joint_limits import stated_limits
from sidegan.robot.setup import Limits
from sidegan.robot.thresholds import FULL_TURN, LIMITS, WIDER_BY
from sidegan.robot.tree import Tree, UrdfJoint, similar_names
from sidegan.robot.units import made_up

_EXAMPLE = {"revolute": (-3.14, 3.14), "prismatic": (0.0, 0.5)}  # suggested ranges [rad or m]
_EXAMPLE_SPEED = {"prismatic": 0.1}  # [m/s]; 1 rad/s for the others
# Attributes of a joint's <limit>, with any prefix.
_DERIVATIVES = {"acceleration": ("acceleration", "deceleration"), "jerk": ("jerk",)}
_Value = TypeVar("_Value")
_Span = tuple[float, float]  # lower and upper limit [rad or m]
# Limits by kind, then joint, as in `Limits`: a range of the position, else a number; infinite for none.
_ByKind = dict[str, dict[str, Any]]
_log = logging.getLogger(__name__)


def limits_of(
    tree: Tree, moving: tuple[UrdfJoint, ...], given: Limits, home: dict[str, float], planning: bool = True
) -> tuple[dict[str, Array], list[str]]:
    """Limits of the moving joints, (J,), named as in `Arm`, and notes on what was assumed.

    They are also written into the tree's XML, since Pinocchio requires them. Continuous joints may turn by
    half a turn from home [rad]. Missing or impossible limits are refused together, with the settings that
    state them, and so are limits in other units; without planning, the former get defaults, and the latter
    are converted.
    """
    given = given.of_joints(joint.name for joint in moving)
    stated, notes = stated_limits(tree, given)
    _check_stated(tree, stated)
    suggested = partial(suggest_limits, given=vars(given))
    described = _Described(home)
    sources: dict[str, Callable[[UrdfJoint], Any]] = {
        "position": described.position,
        "velocity": described.velocity,
        "effort": described.effort,
        **{kind: partial(described.derivative, kind) for kind in DERIVATIVE_ORDER},
    }
    found: _ByKind = {kind: {} for kind in sources}
    for joint in moving:
        for kind, source in sources.items():
            found[kind][joint.name] = stated[kind].get(joint.name) or source(joint)
    doubts, converted = _in_other_units(moving, found, stated)
    wider = list[str]()
    for joint in moving:
        lower, upper = found["position"][joint.name]
        velocity, effort = found["velocity"][joint.name], found["effort"][joint.name]
        attributes = {"lower": lower, "upper": upper, "velocity": velocity, "effort": effort}
        wider += _wider(joint, attributes)
        _write(joint, attributes)
    if described.useless:
        notes.append(f"soft limits that leave no range are ignored: {listed(described.useless)}")
    if described.narrowed:
        whole = suggested({"position": {name: span for name, (span, _) in described.narrowed.items()}})
        notes.append(
            "soft limits apply, since drivers enforce them (safety_controller): "
            f"{listed([words for _, words in described.narrowed.values()])}; for the full range: {whole}"
        )
    if described.missing and planning:
        first, *others = described.missing
        missing = "; ".join([first, *(why.removeprefix(f"{tree.where}: ") for why in others)])
        raise RobotError(f"{missing}; state the arm's limits, for example {suggested(described.examples)}")
    if assumed := _without_blanks(described.examples):
        notes.append(
            f"limits that the description lacks, or cannot have, are assumed to be {suggest_limits(assumed)}"
        )
    if doubts:
        in_si = f"{' '.join(doubts)} In SI units they are then {suggested(converted)}"
        if planning:
            raise RobotError(f"{tree.where}: {in_si}; if not, state the real ones in the same way")
        _log.warning("%s: %s; so they are read", tree.where, in_si)
    for kind in DERIVATIVE_ORDER:
        finite = [name for name, limit in found[kind].items() if math.isfinite(limit)]
        if names := [name for name in finite if name not in stated[kind]]:
            other = suggested({kind: {names[0]: FILL_IN}})
            notes.append(
                f"{kind} limits of {listed(names)} come from the description; {other} overrides them"
            )
    if planning and not any(map(math.isfinite, found["effort"].values())):
        _log.warning(
            "%s has no torque limits, so torques are unchecked; set them by %s",
            tree.where,
            suggested({"effort": dict.fromkeys(found["effort"], FILL_IN)}),
        )
    if wider and planning:
        _log.warning("%s: limits are wider than the description's: %s", tree.where, "; ".join(wider))
    return _arrays(found), notes + _assumed(found, moving, stated["position"], suggested)


def _arrays(found: _ByKind) -> dict[str, Array]:
    """Limits as arrays, (J,), named as in `Arm`; on acceleration and jerk only if there are any."""
    columns = {kind: np.array([*values.values()], dtype=float) for kind, values in found.items()}
    lower, upper = columns["position"].T.copy()
    higher = {kind: columns[kind] for kind in DERIVATIVE_ORDER if np.isfinite(columns[kind]).any()}
    return {
        "position_lower": lower,
        "position_upper": upper,
        "velocity_limit": columns["velocity"],
        "torque_limit": columns["effort"],
        **{f"{kind}_limit": column for kind, column in higher.items()},
    }


def _without_blanks(examples: _ByKind) -> _ByKind:
    """Limits by kind and joint, without those that only the user can fill in."""
    known = {
        kind: {name: x for name, x in values.items() if x != FILL_IN} for kind, values in examples.items()
    }
    return {kind: values for kind, values in known.items() if values}


def _check_stated(tree: Tree, stated: _ByKind) -> None:
    """Raise unless the user's limits, by kind and joint, are of joints that exist, and ranges not empty."""
    for kind, values in stated.items():
        for name in values:
            if name not in tree.joints:
                raise RobotError(
                    f"{tree.where} has no joint {name!r}, as in {setting_name(f'robot.limits.{kind}')}"
                    f"{similar_names(name, tree.joints)}"
                )
    for name, (lower, upper) in stated["position"].items():
        if not lower < upper:
            where = f"{tree.joints[name].at}: {setting_name('robot.limits.position')}"
            raise RobotError(f"{where} is {lower:g} to {upper:g}, expected lower < upper")


class _Described:
    """Limits of a description, or examples for missing and impossible ones, with reasons to refuse it."""

    def __init__(self, home: dict[str, float]) -> None:
        self.home = home
        self.missing: list[str] = []
        self.examples: _ByKind = {}
        self.narrowed: dict[str, tuple[_Span, str]] = {}  # full ranges, and soft limits in words
        self.useless: list[str] = []  # joints whose soft limits leave no range

    def position(self, joint: UrdfJoint) -> _Span:
        """Lower and upper limit [rad or m]; half a turn to each side of home for continuous joints."""
        if joint.kind == "continuous":
            middle = self.home.get(joint.name, 0.0)
            return middle - math.pi, middle + math.pi
        span = joint.span
        if span is None:
            why = "no position limits, expected <limit lower upper>"
            return self._example("position", joint, _EXAMPLE[joint.kind], why)
        lower, upper = span
        if lower < upper:
            return self._softened(joint, span)
        why = f"position limits {lower:g} to {upper:g}, expected lower < upper"
        example = (upper, lower) if lower > upper else _EXAMPLE[joint.kind]
        return self._example("position", joint, example, why)

    def velocity(self, joint: UrdfJoint) -> float:
        """Velocity limit [rad/s or m/s]."""
        velocity = joint.number("limit", "velocity")
        if velocity > 0:
            return velocity
        own = joint.part("limit").get("velocity")
        has = "no velocity limit" if own is None else f"velocity limit {own}, expected more than 0"
        return self._example("velocity", joint, _EXAMPLE_SPEED.get(joint.kind, 1.0), has)

    def effort(self, joint: UrdfJoint) -> float:
        """Torque or force limit [N·m or N]; infinite if none is stated."""
        if motor := joint.part("limit").get("not_read"):
            self._example("effort", joint, FILL_IN, f"a torque limit that is not read: {motor}")
            return math.inf
        effort = joint.number("limit", "effort")
        if effort >= 0:
            return effort or math.inf
        why = f"effort limit {effort:g}, expected more than 0 or none"
        return self._example("effort", joint, -effort, why)

    def derivative(self, kind: str, joint: UrdfJoint) -> float:
        """Acceleration or jerk limit [rad or m, per s² or s³]; infinite if no positive one is stated."""
        keys = [key for key in joint.part("limit").attrib if key.rpartition(":")[2] in _DERIVATIVES[kind]]
        values = [joint.number("limit", key) for key in keys]
        return min((value for value in values if value > 0), default=math.inf)

    def _softened(self, joint: UrdfJoint, span: _Span) -> _Span:
        """A range narrowed by a joint's soft limits, if it has any; a missing end is 0."""
        soft = [joint.number("safety_controller", f"soft_{end}_limit") for end in ("lower", "upper")]
        lower = max(span[0], soft[0])
        upper = min(span[1], soft[1])
        if not any(soft) or (lower, upper) == span:
            return span
        if lower >= upper:
            self.useless.append(joint.name)
            return span
        self.narrowed[joint.name] = span, f"{joint.name} {lower:.4g} to {upper:.4g} {joint.unit}"
        return lower, upper

    def _example(self, kind: str, joint: UrdfJoint, value: _Value, has: str) -> _Value:
        self.missing.append(f"{joint.at} has {has}")
        self.examples.setdefault(kind, {})[joint.name] = value
        return value


def _in_other_units(
    moving: tuple[UrdfJoint, ...], found: _ByKind, stated: _ByKind
) -> tuple[list[str], _ByKind]:
    """Questions on limits that no arm has, and these limits in SI units, to which they are converted.

    The description's and the user's are judged apart. If several limits of a kind, and at least half of them,
    must be in the other unit, all are taken to be; otherwise those above half of the largest that an arm has.
    """
    questions, right = list[str](), _ByKind()
    for kind, slides, users in product(LIMITS, (False, True), (False, True)):
        largest, other, factor = LIMITS[kind][slides]
        joints = [x for x in moving if x.slides == slides and (x.name in stated[kind]) == users]
        joints = [x for x in joints if _questionable(x, kind, users)]
        own = {x: np.atleast_1d(found[kind][x.name]).tolist() for x in joints}
        size = {x: max(map(abs, limits)) for x, limits in own.items()}
        beyond = [x for x in joints if largest < size[x] < math.inf]
        wrong = [x.name for x in beyond if users or not made_up(size[x], largest)]
        if not wrong:
            continue
        least = 0.0 if len(wrong) > 1 and 2 * len(wrong) >= len(own) else largest / 2
        if geared := kind == "velocity" and all(x.reduction > 1 for x in beyond):
            other = "the motors', of which mechanicalReduction makes the joints'"
        values = right.setdefault(kind, {})
        for x in (x for x in joints if least < size[x] < math.inf):
            value = [limit / x.reduction if geared else factor * limit for limit in own[x]]
            found[kind][x.name] = likely = value if len(value) > 1 else value[0]
            values[x.name] = likely if max(map(abs, value)) <= largest else FILL_IN
        questions.append(
            f"{kind} limits of {listed(wrong, 4)} (up to {max(size[x] for x in beyond):.4g}) are beyond any "
            f"arm's: are these {other}?"
        )
    return questions, right


def _questionable(joint: UrdfJoint, kind: str, users: bool) -> bool:
    """Whether a joint's limit may be in another unit.

    Any of the description's may be; of the user's only a range of a joint that the description limits too,
    and not in degrees: to at most a turn.
    """
    if kind != "position":
        return not users
    own = max(abs(xml.number_or_zero(joint.part("limit").get(key))) for key in ("lower", "upper"))
    return joint.kind != "continuous" and (not users or 0 < own <= FULL_TURN)


def _wider(joint: UrdfJoint, limits: dict[str, float]) -> list[str]:
    """Limits wider than the description's, which have its attributes' names, in words with both numbers."""
    force = "N" if joint.slides else "N·m"
    units = {"velocity": f"{joint.unit}/s", "effort": force, "lower": joint.unit, "upper": joint.unit}
    described = {kind: xml.number_or_zero(joint.part("limit").get(kind)) for kind in units}
    ranged = joint.kind != "continuous" and described["lower"] < described["upper"]
    wider = []
    for kind, unit in units.items():
        value, own = limits[kind], described[kind]
        stated = ranged if kind in ("lower", "upper") else own  # an end of a range may be 0
        if stated and (own - value if kind == "lower" else value - own) > WIDER_BY * abs(own):
            wider.append(f"{kind} of {joint.name} {value:.4g} instead of {own:.4g} {unit}")
    return wider


def _assumed(
    found: _ByKind,
    moving: tuple[UrdfJoint, ...],
    stated: dict[str, _Span],
    suggested: Callable[[_ByKind], str],
) -> list[str]:
    """Notes on assumed ranges and unlimited torques."""
    notes = []
    endless = [joint.name for joint in moving if joint.kind == "continuous" and joint.name not in stated]
    if endless:
        spans = {name: found["position"][name] for name in endless}
        wider = {name: [low - math.pi, up + math.pi] for name, (low, up) in spans.items()}
        remedy = suggested({"position": wider})
        ranges = listed([f"{name} {low:.4g} to {up:.4g}" for name, (low, up) in spans.items()])
        notes.append(f"continuous joints may turn half a turn from home: {ranges} rad (for more: {remedy})")
    free = [name for name, effort in found["effort"].items() if not math.isfinite(effort)]
    if free and len(free) < len(moving):
        notes.append(f"no torque limit for {listed(free)}")
    return notes


def _write(joint: UrdfJoint, limits: dict[str, float]) -> None:
    """Write limits into a joint's XML, by their attributes' names, where Pinocchio's parser requires them."""
    element = joint.element
    limit = element.find("limit")
    if limit is None:
        limit = ET.SubElement(element, "limit")
    if joint.kind == "continuous":
        element.set("type", "revolute")
    for key, value in limits.items():
        limit.set(key, repr(value if math.isfinite(value) else 0.0))
