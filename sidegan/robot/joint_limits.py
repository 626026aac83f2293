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
_NESTED = 8  # most levels above joint_limits, as a node's parameters have them


def completed_by_file(tree: Tree, given: Limits) -> tuple[Limits, list[str]]:
    """Given limits, completed by those of their file, and notes on the file.

    Joints that the description does not have are ignored; a file without limits of others is refused.
    """
    if given.file is None:
        return given, []
    setting = suggestion("robot.limits", given.file)
    limits = _read(Path(given.file), setting)
    foreign = [name for name in limits if name not in tree.joints]
    found: dict[str, dict[str, Any]] = {}  # by kind, then joint
    for name, entry in limits.items():
        if name in tree.joints:
            for kind, value in _applicable(entry, tree.span(tree.joints[name])).items():
                found.setdefault(kind, {})[name] = value
    if not found:
        raise RobotError(
            f"{setting} states no limit that applies to a joint of {tree.where}: it names "
            f"{listed([*limits]) or 'no joint'}, expected some of {listed([*tree.joints])}"
        )
    try:
        read = build(Limits, found)
    except ConfigError as error:
        raise RobotError(f"{setting}: {error}") from error
    for name, (lower, upper) in found.get("position", {}).items():
        if lower >= upper:
            raise RobotError(f"{setting}: the positions of {name} are from {lower:g} to {upper:g}")
    ignored = f"; joints that the description does not have are ignored: {listed(foreign)}" if foreign else ""
    note = f"{listed(sorted(found))} limits come from {given.file}{ignored}"
    both: dict[str, Any] = {  # the user's own win
        kind: (getattr(read, kind) or {}) | (getattr(given, kind) or {}) for kind in ("position", *_KINDS)
    }
    return Limits(**both), [note]


def _read(file: Path, setting: str) -> dict[str, Mapping[str, Any]]:
    """A file's entries by joint name; ``setting`` names the file in errors."""
    import yaml

    class Loader(yaml.SafeLoader):  # type: ignore[misc]  # PyYAML is untyped
        """A YAML loader that knows ROS's angle tags."""

    Loader.add_constructor("!degrees", lambda yaml, node: math.radians(float(yaml.construct_scalar(node))))
    Loader.add_constructor("!radians", lambda yaml, node: float(yaml.construct_scalar(node)))
    try:
        content = yaml.load(file.expanduser().read_text(encoding="utf-8"), Loader)
    except (OSError, RuntimeError, ValueError, yaml.YAMLError) as error:  # RuntimeError: no such home
        raise RobotError(f"{setting} cannot be read: {' '.join(str(error).split())}") from error
    for _ in range(_NESTED):
        if isinstance(content, Mapping) and "joint_limits" not in content and len(content) == 1:
            (content,) = content.values()
    limits = content.get("joint_limits") if isinstance(content, Mapping) else None
    if not isinstance(limits, Mapping):
        raise RobotError(f"{setting} has no joint_limits, expected MoveIt's joint_limits.yaml")
    return {str(name): entry for name, entry in limits.items() if isinstance(entry, Mapping)}


def _applicable(limits: Mapping[str, Any], described: tuple[float, float] | None) -> dict[str, Any]:
    """A joint's limits by kind: those that no flag turns off, as in MoveIt.

    A range with one end has the other from the description.
    """
    found = {kind: limits.get(f"max_{kind}") for kind in _KINDS if limits.get(f"has_{kind}_limits", True)}
    ends = limits.get("min_position"), limits.get("max_position")
    if limits.get("has_position_limits", True) and ends != (None, None):
        found["position"] = tuple(
            own if end is None else end for end, own in zip(ends, described or (None, None))
        )
    return {kind: value for kind, value in found.items() if value is not None}
