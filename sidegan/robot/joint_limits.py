"""Limits in a joint_limits.yaml, as MoveIt and the descriptions of ROS have them."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from sidegan.base.names import listed
from sidegan.errors import RobotError
from sidegan.robot.setup import Limits
from sidegan.robot.tree import Tree

_KINDS = ("velocity", "acceleration", "jerk", "effort")


def with_file(tree: Tree, given: Limits) -> tuple[Limits, list[str]]:
    """Limits of which those of a file are part, before which others go, and notes on what it says.

    Joints that the description does not have are left out.

    Raises:
        RobotError: when the file cannot be read, or has no limit of any of the joints.
    """
    if given.file is None:
        return given, []
    found: dict[str, dict[str, Any]] = {}
    others = []
    for name, limits in _joints(Path(given.file).expanduser()):
        if name not in tree.joints:
            others.append(name)
            continue
        for kind, value in _stated(limits, f"{given.file}: {name}"):
            found.setdefault(kind, {})[name] = value
    if not found:
        raise RobotError(
            f"robot.limits={given.file} limits no joint of {tree.where}, but {listed(others) or 'none'}; "
            f"expected some of {listed([*tree.joints])}"
        )
    more = f", beside joints that are not here: {listed(others)}" if others else ""
    note = f"limits of {' and '.join(sorted(found))} are those of {given.file}{more}"
    every: dict[str, Any] = {
        kind: found.get(kind, {}) | (getattr(given, kind) or {}) for kind in ("position", *_KINDS)
    }
    return Limits(**every), [note]


def _joints(file: Path) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Names of joints in a file, and what it says of their limits."""
    import yaml

    class Loader(yaml.SafeLoader):  # type: ignore[misc]  # which has no types
        """Knows angles as ROS writes them."""

    Loader.add_constructor("!degrees", lambda _, node: math.radians(float(node.value)))
    Loader.add_constructor("!radians", lambda _, node: float(node.value))
    try:
        inner = yaml.load(file.read_text(encoding="utf-8"), Loader)
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise RobotError(f"robot.limits={file} cannot be read: {' '.join(str(error).split())}") from error
    while isinstance(inner, Mapping) and "joint_limits" not in inner and len(inner) == 1:
        inner = next(iter(inner.values()))  # of a node's parameters
    limits = inner.get("joint_limits") if isinstance(inner, Mapping) else None
    if not isinstance(limits, Mapping):
        raise RobotError(f"robot.limits={file} has no joint_limits, expected MoveIt's joint_limits.yaml")
    yield from ((str(name), one) for name, one in limits.items() if isinstance(one, Mapping))


def _stated(limits: Mapping[str, Any], where: str) -> Iterator[tuple[str, Any]]:
    """Kinds of limits that count, and their values."""
    for kind in _KINDS:
        if limits.get(f"has_{kind}_limits") and f"max_{kind}" in limits:
            yield kind, _number(limits, f"max_{kind}", where)
    if limits.get("has_position_limits") and {"min_position", "max_position"} <= {*limits}:
        yield "position", tuple(_number(limits, name, where) for name in ("min_position", "max_position"))


def _number(limits: Mapping[str, Any], key: str, where: str) -> float:
    value = limits[key]
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise RobotError(f"{where}: {key} is {value!r}, expected a number")
    if key.startswith("max_") and key != "max_position" and value <= 0:
        raise RobotError(f"{where}: {key} is {value:g}, expected one above 0")
    return float(value)
