"""Limits of the joints that move: of the description, of a MoveIt file, and of the user."""

import difflib
import logging
import math
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar

import yaml

from sidegan.base.names import listed
from sidegan.errors import RobotError
from sidegan.robot import xml
from sidegan.robot.setup import Limits, Setup, override
from sidegan.robot.tree import Joint, Tree, meant

_FILE = {  # MoveIt's names
    "velocity": "max_velocity",
    "acceleration": "max_acceleration",
    "jerk": "max_jerk",
    "effort": "max_effort",
}
_EXAMPLE = {"revolute": (-3.14, 3.14), "prismatic": (0.0, 0.5)}  # ranges to put where there is none
_EXAMPLE_SPEED = {"prismatic": 0.1}  # [m/s]; 1 rad/s of others
_ROUNDED = 1e-3  # share of a limit by which another one may be wider without a word
_TURN, _NEVER = 2.02 * math.pi, 4 * math.pi  # [rad] that joints reach, and that none does which reaches that
_ALIKE = 0.8  # of two names from which on one may be meant by the other
_Value = TypeVar("_Value")
_Stated = dict[str, dict[str, Any]]  # what files and users say, by kind of limit and joint
_Span = tuple[float, float]  # lower and upper limit [rad or m]
_log = logging.getLogger(__name__)


@dataclass
class JointLimits:
    """Limits of one joint that moves [rad or m, and per s, N·m or N]; infinite where there are none."""

    lower: float
    upper: float
    velocity: float
    effort: float
    acceleration: float = math.inf
    jerk: float = math.inf


@dataclass
class _Missing:
    """Limits that have to be asked for: why, and what to set, by kind of limit."""

    why: list[str] = field(default_factory=list)
    values: dict[str, dict[str, object]] = field(default_factory=dict)

    def ask(self, kind: str, joint: str, value: _Value, why: str) -> _Value:
        """Ask for a limit such as this one, which stands for it as long as nobody says another."""
        self.why.append(why)
        self.values.setdefault(kind, {})[joint] = value
        return value


def limits_of(
    tree: Tree, moving: tuple[Joint, ...], setup: Setup, centre: dict[str, float], planning: bool = True
) -> tuple[dict[str, JointLimits], list[str]]:
    """Limits of the joints that move, by name, and what there is to tell about them.

    Args:
        tree: the whole description.
        moving: the joints.
        setup: what overrides the description's limits.
        centre: home position of joints [rad], for the range of those that turn without end.
        planning: whether motions are to be planned; without, plain limits stand for those that are missing.

    Raises:
        RobotError: names all limits that are missing or impossible, with the settings that state them.
    """
    stated, told = _stated(tree, setup)
    _refuse_degrees(tree, moving, stated, setup)
    missing, found, wider = _Missing(), {}, []
    for joint in moving:
        span = _position(tree, joint, stated, missing, centre)
        speed = _velocity(tree, joint, stated, missing)
        effort = _effort(tree, joint, stated, missing)
        bound = [stated[kind].get(joint.name, math.inf) for kind in ("acceleration", "jerk")]
        found[joint.name] = JointLimits(*span, speed, effort, *bound)
        wider += _wider(joint, found[joint.name])
        _write(joint, found[joint.name])
    if missing.why:
        lines = [
            override(f"limits.{kind}", values, getattr(setup.limits, kind))
            for kind, values in missing.values.items()
        ]
        if planning:
            first, *others = missing.why
            said = "; ".join([first, *(why.removeprefix(f"{tree.where}: ") for why in others)])
            raise RobotError(f"{said}; state what the arm can do, for example {' '.join(lines)}")
        told.append(f"limits that the description lacks are taken for {' '.join(lines)}")
    if wider:
        _log.warning("%s: limits are wider than the description's: %s", tree.where, "; ".join(wider))
    return found, [*told, *_tell(found, moving, stated)]


def _refuse_degrees(tree: Tree, moving: tuple[Joint, ...], stated: _Stated, setup: Setup) -> None:
    """Refuse ranges in degrees of joints whose own are in radians and within a turn."""
    far: dict[str, Joint] = {}
    for joint in moving:
        span, own = stated["position"].get(joint.name), _own_span(joint)
        if joint.kind == "revolute" and span and own:
            most, usual = (max(map(abs, one)) for one in (span, own))
            if usual <= _TURN < _NEVER < most:
                far[joint.name] = joint
    if far:
        first = next(iter(far.values()))
        wanted = {name: tuple(map(math.radians, stated["position"][name])) for name in far}
        raise RobotError(
            f"{tree.at(first)}: position limits are {_to(stated['position'][first.name])} rad, and in the "
            f"description {_to(_own_span(first) or (0, 0))}: are these degrees? In radians they are "
            f"{override('limits.position', wanted, setup.limits.position)}"
        )


def _to(span: _Span) -> str:
    return f"{span[0]:.4g} to {span[1]:.4g}"


def _wider(joint: Joint, limits: JointLimits) -> list[str]:
    """Which limits go beyond the description's own, with both numbers."""
    length, force = ("m", "N") if joint.kind == "prismatic" else ("rad", "N·m")
    own, wider = _own_span(joint), []
    if own and joint.kind != "continuous":
        slack = _ROUNDED * (own[1] - own[0])
        if limits.lower < own[0] - slack or limits.upper > own[1] + slack:
            span = _to((limits.lower, limits.upper))
            wider.append(f"position of {joint.name} {span} instead of {_to(own)} {length}")
    for kind, unit in (("velocity", f"{length}/s"), ("effort", force)):
        limit, usual = getattr(limits, kind), _own(joint, kind)
        if usual > 0 and limit > usual * (1 + _ROUNDED):
            wider.append(f"{kind} of {joint.name} {limit:.4g} instead of {usual:.4g} {unit}")
    return wider


def _own_span(joint: Joint) -> _Span | None:
    """Lower and upper limit [rad or m] of the description, where these are such."""
    span = _own(joint, "lower"), _own(joint, "upper")
    return span if span[0] < span[1] else None


def _own(joint: Joint, key: str) -> float:
    """A limit of the description; zero where it states none that can be read."""
    limit = joint.element.find("limit")
    try:
        value = float("0" if limit is None else limit.get(key, "0"))
    except ValueError:
        return 0.0
    return value if math.isfinite(value) else 0.0


def _tell(found: dict[str, JointLimits], moving: tuple[Joint, ...], stated: _Stated) -> list[str]:
    """Notes on assumed ranges, and on torques that are not limited."""
    told = []
    endless = [j.name for j in moving if j.kind == "continuous" and j.name not in stated["position"]]
    if endless:
        spans = {name: (found[name].lower, found[name].upper) for name in endless}
        wider = {name: [low - math.pi, high + math.pi] for name, (low, high) in spans.items()}
        ranges = listed([f"{name} {_to(span)}" for name, span in spans.items()])
        more = override("limits.position", wider)
        told.append(f"continuous joints may go half a turn from home: {ranges} rad ({more} for more)")
    free = [joint.name for joint in moving if not math.isfinite(found[joint.name].effort)]
    if free and len(free) < len(moving):
        told.append(f"no limit on the torque of {listed(free)}")
    return told


def _write(joint: Joint, limits: JointLimits) -> None:
    """Put limits where Pinocchio's parser insists on them, and a range where there was none."""
    element = joint.element
    limit = element.find("limit")
    if limit is None:
        limit = xml.ET.SubElement(element, "limit")
    if joint.kind == "continuous":
        element.set("type", "revolute")
    numbers = {"lower": limits.lower, "upper": limits.upper, "velocity": limits.velocity}
    for key, value in {**numbers, "effort": limits.effort}.items():
        limit.set(key, repr(value if math.isfinite(value) else 0.0))


def _position(
    tree: Tree, joint: Joint, stated: _Stated, missing: _Missing, centre: dict[str, float]
) -> _Span:
    """Lower and upper limit [rad or m]; half a turn to each side of home where a joint turns without end."""
    at, name = tree.at(joint), joint.name
    if name in stated["position"]:
        return _ordered(at, stated["position"][name])
    limit = joint.element.find("limit")
    if joint.kind == "continuous":
        middle = centre.get(name, 0.0)
        return middle - math.pi, middle + math.pi
    example = _EXAMPLE[joint.kind]
    if limit is None or not {"lower", "upper"} & set(limit.attrib):
        why = f"{at} has no position limits, expected <limit lower upper>"
        return missing.ask("position", name, example, why)
    lower, upper = (xml.number(limit, key, at, "0") for key in ("lower", "upper"))
    if not lower < upper:
        why = f"{at} has the position limits {lower:g} to {upper:g}, expected lower < upper"
        return missing.ask("position", name, (upper, lower) if lower > upper else example, why)
    return lower, upper


def _velocity(tree: Tree, joint: Joint, stated: _Stated, missing: _Missing) -> float:
    """Limit on velocity [rad/s or m/s]."""
    if joint.name in stated["velocity"]:
        return stated["velocity"][joint.name]
    limit, at = joint.element.find("limit"), tree.at(joint)
    text = None if limit is None else limit.get("velocity")
    velocity = 0.0 if limit is None else xml.number(limit, "velocity", at, "0")
    if not velocity > 0:
        example = _EXAMPLE_SPEED.get(joint.kind, 1.0)
        why = f"{at} has the velocity limit {text}, expected one above 0"
        return missing.ask("velocity", joint.name, example, why)
    return velocity


def _effort(tree: Tree, joint: Joint, stated: _Stated, missing: _Missing) -> float:
    """Limit on torque or force [N·m or N]; infinite where none is stated."""
    if joint.name in stated["effort"]:
        return stated["effort"][joint.name]
    limit, at = joint.element.find("limit"), tree.at(joint)
    effort = 0.0 if limit is None else xml.number(limit, "effort", at, "0")
    if effort < 0:
        why = f"{at} has the effort limit {effort:g}, expected one above 0, or none"
        return missing.ask("effort", joint.name, -effort, why)
    return effort or math.inf


def _ordered(at: str, span: _Span) -> _Span:
    if not span[0] < span[1]:
        raise RobotError(f"{at}: robot.limits.position is {span[0]:g} to {span[1]:g}, expected lower < upper")
    return span


def _stated(tree: Tree, setup: Setup) -> tuple[_Stated, list[str]]:
    """Limits of the file, overridden by those that the user states."""
    stated: _Stated = {kind.name: {} for kind in fields(Limits)}
    told = _read_file(tree, Path(setup.limits_file).expanduser(), stated) if setup.limits_file else []
    for kind, values in stated.items():
        given = getattr(setup.limits, kind) or {}
        for name in given:
            if name not in tree.joints:
                raise RobotError(
                    f"{tree.where} has no joint {name!r} of robot.limits.{kind}{meant(name, tree.joints)}"
                )
        values.update(given)
    return stated, told


def _read_file(tree: Tree, path: Path, stated: _Stated) -> list[str]:
    """Read a MoveIt joint_limits.yaml; what is to be told about it."""
    if not path.is_file():
        raise RobotError(f"there is no file robot.limits_file={path}")
    try:
        content = yaml.load(path.read_bytes(), _Loader)
    except OSError as error:
        raise RobotError(f"cannot read robot.limits_file={path}: {error.strerror}") from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise RobotError(f"{path} is no YAML: {' '.join(str(error).split())}") from error
    joints = content.get("joint_limits") if isinstance(content, dict) else None
    if not isinstance(joints, dict) or not all(isinstance(one, dict) for one in joints.values()):
        raise RobotError(f"{path} has no joint_limits, expected a joint_limits.yaml of MoveIt")
    known = [name for name in joints if name in tree.joints]
    if not known:
        raise RobotError(f"{path} limits {listed(list(joints))}, of which {tree.where} has none")
    for name in known:
        _read_joint(f"{path}: joint {name!r}", name, joints[name], stated)
    rest = [str(name) for name in joints if name not in tree.joints]
    if not rest:
        return []
    free = tree.joints.keys() - set(known)
    close = dict.fromkeys(near for name in rest for near in difflib.get_close_matches(name, free, 1, _ALIKE))
    told = f"{path.name} limits {listed(rest)}, which {'is' if len(rest) == 1 else 'are'} not there"
    return [f"{told}; did you mean {listed([*close])}?" if close else told]


def _read_joint(at: str, name: str, values: dict[str, object], stated: _Stated) -> None:
    """Read what a MoveIt file says about one joint."""

    def number(key: str) -> float:
        value = values.get(key)
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise RobotError(f"{at}: {key} is {value!r}, expected a number")
        return float(value)

    for kind, key in _FILE.items():
        plural = f"has_{kind}_limits"
        if key in values and values.get(plural, True):
            limit = number(key)
            if not limit > 0:
                raise RobotError(f"{at}: {key} is {limit:g}, expected one above 0, or {plural}: false")
            stated[kind][name] = limit
    if values.get("has_position_limits", True) and {"min_position", "max_position"} <= set(values):
        stated["position"][name] = _ordered(at, (number("min_position"), number("max_position")))


class _Loader(yaml.SafeLoader):
    """YAML with the angles that ROS writes: `!degrees 90`."""


_Loader.add_constructor("!degrees", lambda loader, node: math.radians(float(str(node.value))))
_Loader.add_constructor("!radians", lambda loader, node: float(str(node.value)))
