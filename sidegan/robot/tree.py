"""Kinematic tree of a description."""

import difflib
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Container, Iterable
from dataclasses import dataclass
from functools import cached_property

from sidegan.base.settings_text import suggestion
from sidegan.errors import RobotError
from sidegan.robot import xml
from sidegan.robot.units import reductions_of

TURNING = ("revolute", "continuous")
WORLD = "world"  # a link of this name is no part of the arm
MOVABLE = (*TURNING, "prismatic")
# Elements of Drake and Gazebo, with any prefix, that tie two links beside the joints of the tree.
_TIES = "loop_joint", "joint", "ball_constraint", "linear_bushing_rpy"
REFUSED = {  # joint types that an arm cannot have, and why
    "floating": "the arm's base must be fixed",
    "planar": "a joint must have one degree of freedom",
    "ball": "a joint must have one degree of freedom",  # only from an MJCF
}


@dataclass(frozen=True)
class UrdfJoint:
    """A joint of a description."""

    name: str
    kind: str  # joint type
    parent: str  # link
    child: str  # link
    element: ET.Element
    at: str  # location, for messages
    reduction: float = 1.0  # of the gear, if a transmission states it

    @property
    def slides(self) -> bool:
        """Whether it is prismatic."""
        return self.kind == "prismatic"

    @property
    def unit(self) -> str:
        """Unit of its position."""
        return "m" if self.slides else "rad"

    @property
    def leader(self) -> str | None:
        """The joint that it mimics, if it mimics one; empty if that has no name."""
        mimic = self.element.find("mimic")
        return None if mimic is None else mimic.get("joint", "")

    @property
    def span(self) -> tuple[float, float] | None:
        """Its stated range [rad or m], with 0 for a missing end; None if it has none."""
        if self.kind == "continuous" or not {"lower", "upper"} & set(self.part("limit").attrib):
            return None
        return self.number("limit", "lower"), self.number("limit", "upper")

    def part(self, tag: str) -> ET.Element:
        """A child element, such as the limit; an empty element if there is none."""
        found = self.element.find(tag)
        return ET.Element(tag) if found is None else found

    def number(self, tag: str, key: str, default: str = "0") -> float:
        """A finite number of a child element; the default if that or its attribute is missing."""
        return xml.scalar(self.part(tag), key, self.at, default)


@dataclass(frozen=True)
class Tree:
    """The joints of a description whose links form a single tree."""

    where: str  # the description, for messages
    root: str  # the base link
    joints: dict[str, UrdfJoint]
    extras: tuple[ET.Element, ...] = ()  # neither links nor joints

    @cached_property
    def above(self) -> dict[str, UrdfJoint]:
        """The parent joint of each link but the root."""
        return {joint.child: joint for joint in self.joints.values()}

    @property
    def links(self) -> list[str]:
        """All links, the root first."""
        return [self.root, *self.above]

    def path(self, link: str) -> list[UrdfJoint]:
        """The joints from the root to a link."""
        found: list[UrdfJoint] = []
        while link in self.above and len(found) <= len(self.joints):  # stops in a loop
            found.append(self.above[link])
            link = found[-1].parent
        return found[::-1]

    @cached_property
    def loops(self) -> dict[str, set[str]]:
        """Names of the joints between links that other elements tie, by these elements in words."""
        found = {}
        inner = [element for extra in self.extras for element in extra.iter()]
        links = {x.get("name", ""): x.get("link", "") for x in inner if _tag(x) == "frame"}
        links |= {link: link for link in self.links}
        for element in inner:
            ends = [part.get("link") or part.get("name") or (part.text or "").strip() for part in element]
            tied = [links[end] for end in ends if end in links]
            if _tag(element) == "loop_joint" or (_tag(element) in _TIES and len(tied) == 2):
                paths = [{joint.name for joint in self.path(link)} for link in tied]
                name = f"{_tag(element)} {element.get('name', '')} ({', '.join(tied)})"
                found[name] = paths[0] ^ paths[1] if len(paths) == 2 else set()
        return found

    def parents(self, shaped: Container[str]) -> frozenset[tuple[str, str]]:
        """Links with a shape, each with its nearest ancestor that has a shape.

        Not the world, nor a fixed link behind one without a shape: they may be a pillar or a wall.
        """
        found = set()
        for link in self.links:
            path = self.path(link)
            before = [joint.parent for joint in path if joint.parent in shaped]
            if link not in shaped or not before:
                continue
            still = all(joint.kind == "fixed" for joint in self.path(before[-1]))
            moves = any(joint.kind != "fixed" for joint in path)
            apart = before[-1] == WORLD or before[-1] != path[-1].parent
            if not (still and moves and apart):
                found.add((link, before[-1]))
        return frozenset(found)

    def require_link(self, name: str, setting: str = "") -> None:
        """Raise unless there is a link with this name."""
        if name not in self.links:
            raise RobotError(f"{self.where} has no link {name!r}{similar_names(name, self.links, setting)}")


def similar_names(name: str, known: Iterable[str], setting: str = "") -> str:
    """End of a message: known names similar to an unknown one, or settings of this name that have them."""
    names = list(known)
    if not names:
        return ""
    close = difflib.get_close_matches(name, names, 3, 0.5) or names[-3:]
    return ", expected for example " + " or ".join(
        suggestion(setting, match) if setting else match for match in close
    )


def read_tree(root: ET.Element, where: str) -> Tree:
    """The tree of a description; raises unless names are unique and links form a single tree."""
    names = {
        kind: [xml.attribute(x, "name", where) for x in root.findall(kind)] for kind in ("link", "joint")
    }
    for kind, given in names.items():
        name, count = Counter(given).most_common(1)[0] if given else ("", 0)
        if count > 1:
            raise RobotError(f"{where} has {count} {kind}s named {name!r}, expected unique names")
    joints: dict[str, UrdfJoint] = {}
    children: set[str] = set()
    gears = reductions_of(root)
    for element, name in zip(root.findall("joint"), names["joint"]):
        joint = joints[name] = _joint(element, name, f"{where}: joint {name!r}", gears.get(name, 1.0))
        for link in (joint.parent, joint.child):
            if link not in names["link"]:
                raise RobotError(f"{joint.at} refers to link {link!r}, which does not exist")
        if joint.child in children:
            raise RobotError(
                f"{joint.at} is a second joint with child link {joint.child!r}; expected no loops"
            )
        children.add(joint.child)
    bases = [link for link in names["link"] if link not in children]
    if not names["link"]:
        raise RobotError(f"{where} has no link, expected those of an arm")
    if not bases:
        raise RobotError(
            f"{where}: joints form a loop, since every link is the child of one; expected a base"
        )
    if len(bases) != 1:
        raise RobotError(f"{where} has {len(bases)} links without a parent {bases}, expected only the base")
    extras = [element for element in root if element.tag not in ("link", "joint")]
    tree = Tree(where, bases[0], joints, tuple(extras))
    if astray := sorted(link for link in children if not tree.path(link)[0].parent == bases[0]):
        raise RobotError(f"{where}: no joints connect {bases[0]!r} to {', '.join(astray)}, expected one tree")
    return tree


def _tag(element: ET.Element) -> str:
    """An element's tag without its prefix."""
    return element.tag.rpartition(":")[2]


def _joint(element: ET.Element, name: str, at: str, reduction: float) -> UrdfJoint:
    """A joint of a known kind, with two links and a valid placement."""
    parent, child = (xml.attribute(xml.child(element, e, at), "link", at) for e in ("parent", "child"))
    kind = element.get("type", "")
    if kind not in (*MOVABLE, *REFUSED, "fixed"):
        raise RobotError(f"{at} is of type {kind!r}, expected revolute, prismatic, continuous or fixed")
    xml.origin(element, at)
    return UrdfJoint(name, kind, parent, child, element, at, reduction)
