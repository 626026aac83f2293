"""A URDF read, checked and reduced to what the physics needs, before Pinocchio sees it."""

import math
import xml.etree.ElementTree as ET
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from sidegan.errors import RobotError
from sidegan.robot import xml
from sidegan.robot.links import check_inertia, prepare_shapes

_MOST_LINKS = 500  # Pinocchio goes down a tree by recursion, and some thousands end the process
_AXIS = (1e-6, 1e6)  # length of an axis that can be made one
_MOVABLE = ("revolute", "prismatic")
_REFUSED = {
    "continuous": "it has no position limits; make it revolute, with a lower and an upper one",
    "floating": "the arm's base must be fixed",
    "planar": "a joint must have one degree of freedom",
}


@dataclass(frozen=True)
class Description:
    """What is known of an arm before Pinocchio reads it."""

    name: str  # the robot's name
    path: Path  # the file
    xml: str  # the URDF without what is only for show, with absolute mesh paths
    # lower, upper, velocity, effort of each joint that moves [rad or m, per s, N·m or N]
    limits: dict[str, tuple[float, float, float, float]]
    moved: dict[str, str]  # the link that each of these joints leads to
    shapeless: list[str]  # links that lack a shape because a mesh file is missing


def read_description(path: Path) -> Description:
    """A checked description of an arm.

    Raises:
        RobotError: when the file is not a URDF, or describes no arm that can be excited.
    """
    root = xml.parse(path)
    name = root.get("name") or path.stem
    root.set("name", name)
    for extra in [element for element in root if element.tag not in ("link", "joint")]:
        root.remove(extra)
    _check_tree(root, str(path))
    limits, moved = {}, {}
    for joint in root.findall("joint"):
        where = f"{path}: joint {joint.get('name')!r}"
        if _moves(joint, where):
            limits[joint.get("name", "")] = _limits(joint, where)
            moved[joint.get("name", "")] = xml.child(joint, "child", where).get("link", "")
    if not limits:
        raise RobotError(f"{path} has no joints that move, expected at least one, revolute or prismatic")
    shapeless = []
    for link in root.findall("link"):
        where = f"{path}: link {link.get('name')!r}"
        check_inertia(link, where)
        if not prepare_shapes(link, path, where):
            shapeless.append(link.get("name", ""))
    return Description(name, path, ET.tostring(root, encoding="unicode"), limits, moved, shapeless)


def _check_tree(root: ET.Element, where: str) -> None:
    """Raise unless links and joints have names of their own and form one tree."""
    joints = root.findall("joint")
    if (count := len(root.findall("link"))) > _MOST_LINKS:
        raise RobotError(f"{where} has {count} links, expected at most {_MOST_LINKS}")
    names = {
        "link": [xml.attribute(link, "name", where) for link in root.findall("link")],
        "joint": [xml.attribute(joint, "name", where) for joint in joints],
    }
    for kind, given in names.items():
        name, count = Counter(given).most_common(1)[0] if given else ("", 0)
        if count > 1:
            raise RobotError(f"{where} has {count} {kind}s named {name!r}, expected different names")
    parents: dict[str, str] = {}
    for joint, name in zip(joints, names["joint"]):
        at = f"{where}: joint {name!r}"
        parent, child = (xml.attribute(xml.child(joint, end, at), "link", at) for end in ("parent", "child"))
        for link in (parent, child):
            if link not in names["link"]:
                raise RobotError(f"{at} joins the link {link!r}, which is not there")
        if child in parents:
            raise RobotError(f"{at} leads to link {child!r}, as another joint does; expected no loops")
        parents[child] = parent
    bases = [link for link in names["link"] if link not in parents]
    if len(bases) != 1:
        raise RobotError(f"{where} has {len(bases)} links without a parent {bases}, expected one, the base")
    reached = set(bases)
    while more := {child for child, parent in parents.items() if parent in reached} - reached:
        reached |= more
    if astray := sorted(set(names["link"]) - reached):
        raise RobotError(
            f"{where}: no joints lead from {bases[0]!r} to {', '.join(astray)}, expected one tree"
        )


def _moves(joint: ET.Element, where: str) -> bool:
    """Whether a joint is of a kind that moves, with kind and origin checked."""
    kind = joint.get("type")
    if kind in _REFUSED:
        raise RobotError(f"{where} is {kind}: {_REFUSED[kind]}")
    if kind not in (*_MOVABLE, "fixed"):
        raise RobotError(f"{where} is of type {kind!r}, expected revolute, prismatic or fixed")
    for key in ("xyz", "rpy"):
        xml.vector(joint.find("origin"), key, where, "0 0 0")
    return kind in _MOVABLE


def _limits(joint: ET.Element, where: str) -> tuple[float, float, float, float]:
    """Lower, upper, velocity and effort limit of a joint that moves."""
    if joint.find("mimic") is not None:
        raise RobotError(f"{where} mimics another, expected joints that move on their own")
    axis = xml.vector(joint.find("axis"), "xyz", where, "1 0 0")
    if not _AXIS[0] <= math.hypot(*axis) <= _AXIS[1]:
        words = " ".join(f"{x:g}" for x in axis)
        raise RobotError(f"{where} has the axis {words}, expected a direction, of about unit length")
    limit = joint.find("limit")
    if limit is None or not {"lower", "upper"} & set(limit.attrib):
        raise RobotError(f"{where} has no position limits, expected <limit lower upper velocity>")
    lower, upper = (xml.number(limit, key, where, "0") for key in ("lower", "upper"))
    if not lower < upper:
        raise RobotError(f"{where} has the position limits {lower:g} to {upper:g}, expected lower < upper")
    velocity = xml.number(limit, "velocity", where, "0")
    if not velocity > 0:
        raise RobotError(f"{where} has the velocity limit {limit.get('velocity')}, expected one above 0")
    effort = xml.number(limit, "effort", where, "0")
    if effort < 0:
        raise RobotError(f"{where} has the effort limit {effort:g}, expected one above 0, or none")
    limit.set("effort", repr(effort))  # may be absent here, but not in Pinocchio's parser
    return lower, upper, velocity, effort or math.inf
