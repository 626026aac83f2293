"""Semantics of an SRDF beside the description: named poses, and pairs of links that may touch."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from sidegan.base.names import listed
from sidegan.errors import RobotError
from sidegan.robot import xml
from sidegan.robot.setup import Setup
from sidegan.robot.tree import Tree


@dataclass(frozen=True)
class Semantics:
    """Named poses and pairs of links whose collisions need no check."""

    where: str  # the file, for messages; empty where there is none
    poses: dict[str, dict[str, float]] = field(default_factory=dict)  # joint positions [rad or m] by name
    disabled: tuple[tuple[str, str, str], ...] = ()  # two links, and the reason

    def pose(self, name: str, joints: Sequence[str]) -> dict[str, float]:
        """Positions of these joints in a named pose [rad or m].

        Raises:
            RobotError: when there is no such pose, or it leaves joints out.
        """
        if not self.where:
            raise RobotError(
                f"robot.home is {name!r}, a pose that an SRDF would name: add robot.srdf=arm.srdf, or "
                "give numbers, 'trajectory.home=[…]'"
            )
        known = sorted(name for name, pose in self.poses.items() if pose.keys() >= {*joints})
        if name in known:
            return {joint: self.poses[name][joint] for joint in joints}
        expected = (
            f"expected robot.home={' or robot.home='.join(known)}" if known else "it has no pose of the arm"
        )
        if name in self.poses:
            lacking = [joint for joint in joints if joint not in self.poses[name]]
            raise RobotError(f"{self.where}: pose {name!r} leaves out {listed(lacking)}; {expected}")
        raise RobotError(f"{self.where} has no pose {name!r}; {expected}")


def read_semantics(setup: Setup, tree: Tree, poses: Mapping[str, dict[str, float]]) -> Semantics:
    """Semantics of a setup's SRDF, and poses that the description itself names.

    Raises:
        RobotError: when the SRDF is not there, or is none.
    """
    if not setup.srdf:
        return Semantics(tree.where if poses else "", dict(poses))
    path = Path(setup.srdf).expanduser()
    if not path.is_file():
        raise RobotError(f"there is no file robot.srdf={path}")
    root = xml.parse(path)
    found = {name: dict(pose) for name, pose in poses.items()}
    for state in root.findall("group_state"):
        name = xml.attribute(state, "name", str(path))
        found.setdefault(name, {}).update(_pose(state, f"{path}: pose {name!r}"))
    disabled = []
    for pair in root.findall("disable_collisions"):
        one, other = (xml.attribute(pair, key, str(path)) for key in ("link1", "link2"))
        disabled.append((one, other, pair.get("reason", "")))
    return Semantics(str(path), found, tuple(disabled))


def touching_in(root: ET.Element, where: str) -> tuple[tuple[str, str, str], ...]:
    """Pairs of links that a description itself lets touch: `<disable_collisions>` as in an SRDF, and why."""
    found = []
    for pair in root.findall("disable_collisions"):
        one, other = (xml.attribute(pair, key, where) for key in ("link1", "link2"))
        found.append((one, other, pair.get("reason") or "the description"))
    return tuple(found)


def touching_of(setup: Setup, tree: Tree, semantics: Semantics) -> tuple[tuple[str, str, str], ...]:
    """Pairs of links that a user lets touch, by name or by an SRDF, and who says so.

    Raises:
        RobotError: when there is no such link.
    """
    for name in [name for pair in setup.may_touch or () for name in pair]:
        tree.require_link(name)
    named = tuple((one, other, "robot.may_touch") for one, other in setup.may_touch or ())
    disabled = semantics.disabled if setup.srdf_pairs else ()
    return named + tuple((one, other, f"SRDF: {why or 'no reason'}") for one, other, why in disabled)


def _pose(state: ET.Element, where: str) -> dict[str, float]:
    """Positions of joints with one degree of freedom [rad or m]; others are left out."""
    pose = {}
    for joint in state.findall("joint"):
        name = xml.attribute(joint, "name", where)
        if len(joint.get("value", "").split()) == 1:
            pose[name] = xml.number(joint, "value", f"{where}: joint {name!r}")
    return pose
