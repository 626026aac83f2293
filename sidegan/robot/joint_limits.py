"""Joint limits from a joint_limits.yaml, as in MoveIt and ROS descriptions."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sidegan.base.names import listed
from sidegan.base.settings_text import suggestion
from sidegan.base.typed import build
from sidegan.errors import ConfigError, RobotError
from sidegan.robot.setup import Limits
from sidegan.robot.tree import Tree

_KINDS = ("velocity", "acceleration", "jerk", "effort")
_NESTED = 8  # most levels of mappings down to joint_limits, such as those of a node's parameters


def stated_limits(tree: Tree, given: Limits) -> tuple[dict[str, dict[str, Any]], list[str]]:
    """The user's limits by kind and joint, completed by those of their file, and notes on the file.

    Entries of joints that the description lacks are ignored; a file without a limit of the others is refused.
    """
    own = {kind: values or {} for kind, values in vars(given).items() if kind != "file"}
    if given.file is None:
        return own, []
    setting = suggestion("robot.limits", given.file)
    limits = _read(Path(given.file), setting)
    foreign = [name for name in limits if name not in tree.joints]
    found: dict[str, dict[str, Any]] = {}  # by kind, then joint
    for name, entry in limits.items():
        if name in tree.joints:
            for kind, value in _applicable(entry, tree.joints[name].span).items():
                if kind == "position" and None in value:
                    raise RobotError(f"{setting} gives {name} one end of a range, and the description none")
                found.setdefault(kind, {})[name] = value
    if not found:
        named = f"it names {listed([*limits]) or 'no joint'}, expected some of {listed([*tree.joints])}"
        known = listed([name for name in limits if name in tree.joints])
        why = f"none is stated of {known}, or has_…_limits: false turns it off" if known else named
        raise RobotError(f"{setting} states no limit that applies to a joint of {tree.where}: {why}")
    try:
        read = build(Limits, found)
    except ConfigError as error:
        raise RobotError(f"{setting}: {error}") from error
    for name, (lower, upper) in found.get("position", {}).items():
        if lower >= upper:
            raise RobotError(f"{setting}: the positions of {name} are from {lower:g} to {upper:g}")
    ignored = f"; joints that the description does not have are ignored: {listed(foreign)}" if foreign else ""
    note = f"{listed(sorted(found))} limits come from {given.file}{ignored}"
    return {kind: (getattr(read, kind) or {}) | values for kind, values in own.items()}, [note]


def _read(file: Path, setting: str) -> dict[str, Mapping[str, Any]]:
    """A file's entries by joint name; ``setting`` names the file in errors."""
    import yaml

    class Loader(yaml.SafeLoader):  # type: ignore[misc]  # PyYAML is untyped
        """A YAML loader that knows ROS's angle tags."""

    Loader.add_constructor(
        "!degrees", lambda loader, node: math.radians(float(loader.construct_scalar(node)))
    )
    Loader.add_constructor("!radians", lambda loader, node: float(loader.construct_scalar(node)))
    try:
        content = yaml.load(file.expanduser().read_text(encoding="utf-8"), Loader)
    except (OSError, RuntimeError, ValueError, yaml.YAMLError) as error:  # RuntimeError: no such home
        raise RobotError(f"{setting} cannot be read: {' '.join(str(error).split())}") from error
    limits = _within(content, _NESTED)
    if limits is None:
        raise RobotError(f"{setting} has no joint_limits, expected MoveIt's joint_limits.yaml")
    return {str(name): entry for name, entry in limits.items() if isinstance(entry, Mapping)}


def _within(content: Any, depth: int) -> Mapping[Any, Any] | None:
    """The first mapping named joint_limits, at most ``depth`` levels deep; None if there is none."""
    if not isinstance(content, Mapping) or depth == 0:
        return None
    if isinstance(limits := content.get("joint_limits"), Mapping):
        return limits
    found = (_within(inner, depth - 1) for inner in content.values())
    return next((limits for limits in found if limits is not None), None)


def _applicable(limits: Mapping[str, Any], described: tuple[float, float] | None) -> dict[str, Any]:
    """A joint's limits by kind, except those that ``has_…_limits: false`` turns off, as in MoveIt.

    If only one end of a range is given, the other is the description's [rad or m].
    """
    found = {kind: limits.get(f"max_{kind}") for kind in _KINDS if limits.get(f"has_{kind}_limits", True)}
    ends = limits.get("min_position"), limits.get("max_position")
    if limits.get("has_position_limits", True) and ends != (None, None):
        found["position"] = tuple(
            own if end is None else end for end, own in zip(ends, described or (None, None))
        )
    return {kind: value for kind, value in found.items() if value is not None}
