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


def with_file(tree: Tree, given: Limits) -> tuple[Limits, list[str]]:
    """Given limits, completed by those of their file, and notes on the file.

    Joints that the description does not have are ignored; a file without any others is refused.
    """
    if given.file is None:
        return given, []
    at = suggestion("robot.limits", given.file)
    limits = _read(Path(given.file).expanduser(), at)
    others = [name for name in limits if name not in tree.joints]
    found: dict[str, dict[str, Any]] = {}
    for name, entry in limits.items():
        if name in tree.joints:
            for kind, value in _stated(entry).items():
                found.setdefault(kind, {})[name] = value
    if not found:
        raise RobotError(
            f"{at} has limits for {listed(others) or 'no joint'}, none of which is in "
            f"{tree.where}; expected some of {listed([*tree.joints])}"
        )
    try:
        read = build(Limits, found)
    except ConfigError as error:
        raise RobotError(f"{at}: {error}") from error
    ignored = f"; joints that the arm does not have are ignored: {listed(others)}" if others else ""
    note = f"{' and '.join(sorted(found))} limits come from {given.file}{ignored}"
    both: dict[str, Any] = {
        kind: (getattr(read, kind) or {}) | (getattr(given, kind) or {}) for kind in ("position", *_KINDS)
    }
    return Limits(**both), [note]


def _read(file: Path, at: str) -> dict[str, Mapping[str, Any]]:
    """A file's entries by joint name; ``at`` is the setting that names it, for errors."""
    import yaml

    class Loader(yaml.SafeLoader):  # type: ignore[misc]  # PyYAML is untyped
        """A YAML loader that knows ROS's angle tags."""

    Loader.add_constructor("!degrees", lambda _, node: math.radians(float(node.value)))
    Loader.add_constructor("!radians", lambda _, node: float(node.value))
    try:
        inner = yaml.load(file.read_text(encoding="utf-8"), Loader)
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise RobotError(f"{at} cannot be read: {' '.join(str(error).split())}") from error
    while isinstance(inner, Mapping) and "joint_limits" not in inner and len(inner) == 1:
        inner = next(iter(inner.values()))  # nested in a node's parameters
    limits = inner.get("joint_limits") if isinstance(inner, Mapping) else None
    if not isinstance(limits, Mapping):
        raise RobotError(f"{at} has no joint_limits, expected MoveIt's joint_limits.yaml")
    return {str(name): entry for name, entry in limits.items() if isinstance(entry, Mapping)}


def _stated(limits: Mapping[str, Any]) -> dict[str, Any]:
    """A joint's limits that are declared to apply, by kind."""
    found = {kind: limits.get(f"max_{kind}") for kind in _KINDS if limits.get(f"has_{kind}_limits")}
    if limits.get("has_position_limits") and {"min_position", "max_position"} <= {*limits}:
        found["position"] = limits["min_position"], limits["max_position"]
    return {kind: value for kind, value in found.items() if value is not None}
