"""A description read, checked and reduced to what the physics needs, before Pinocchio sees it."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from sidegan.robot import xml
from sidegan.robot.arm import FilePlane
from sidegan.robot.chain import choose
from sidegan.robot.drives import Drives, described_drives
from sidegan.robot.fixed_joints import describe_fixed
from sidegan.robot.limits import JointLimits, limits_of
from sidegan.robot.links import prepare_shapes, read_mass
from sidegan.robot.locking import lock, unit_axis
from sidegan.robot.mounting import GRAVITY, hang, mount_of, turned
from sidegan.robot.postures import group_states, home_among
from sidegan.robot.setup import PLAIN, Mount, Setup
from sidegan.robot.sources import read_source
from sidegan.robot.tree import read_tree

T = TypeVar("T")


@dataclass(frozen=True)
class Description:
    """Description of an arm before Pinocchio reads it."""

    name: str  # the robot's name
    path: Path  # the file
    xml: str  # a URDF of the arm without what is only for show, with absolute mesh paths
    limits: dict[str, JointLimits]  # of each joint that moves
    moved: dict[str, str]  # the link that each of these joints leads to
    missing: dict[str, list[str]]  # mesh files that are not there, by the link that lacks them
    notes: list[str]  # what was decided for the user
    parents: frozenset[tuple[str, str]]  # links, and the nearest ones with a shape towards the base
    may_touch: tuple[tuple[str, str, str], ...]  # links that are not kept apart, and who says so
    mount: Mount  # roll, pitch and yaw [rad] of the first link, in a world whose z points up
    planes: tuple[FilePlane, ...]  # in that world
    gravity: float  # [m/s²], which acts down
    home: tuple[float, ...] | None  # where the joints that move rest by it [rad or m]
    drives: Drives | None  # friction and rotors that are stated, unless these are not to count


def read_description(
    path: Path, setup: Setup = PLAIN, home: Sequence[float] | None = None, planning: bool = True
) -> Description:
    """A checked description of an arm; arguments as of `load_robot`.

    Raises:
        RobotError: when the file is no description, or describes no arm that can be excited.
    """
    source = read_source(path, setup.args)
    root, where = source.root, str(path)
    name = root.get("name") or path.stem
    root.set("name", name)
    may_touch = _touching(root, where)
    for extra in [element for element in root if element.tag not in ("link", "joint")]:
        root.remove(extra)
    tree = read_tree(root, where)
    moving, locked = choose(tree, setup)
    for joint in moving:
        unit_axis(joint, tree.at(joint))
    read = _of_links(root, where, read_mass)
    notes = describe_fixed(tree, moving, locked, {name: mass for name, (mass, _) in read.items()})
    for joint, value in ((tree.joints[name], value) for name, value in locked.items()):
        lock(joint, value, tree.at(joint))
    moved = {joint.name: joint.child for joint in moving}
    middle = dict(zip(moved, home)) if home is not None and len(home) == len(moved) else {}
    limits, more = limits_of(tree, moving, setup.limits, middle, planning)
    for pair in setup.may_touch or ():
        for link in pair:
            tree.require_link(link)
        may_touch += ((*pair, "robot.may_touch"),)
    absent = _of_links(root, where, lambda link, at: prepare_shapes(link, path, at, meshes=planning))
    missing = {name: files for name, files in absent.items() if files}
    missing |= source.missing if planning else {}
    mount = mount_of(setup.mount, source.gravity)
    if any(mount):
        hang(root, tree.root, mount)
        notes.append(f"mounted with roll {mount[0]:.4g}, pitch {mount[1]:.4g} and yaw {mount[2]:.4g} rad")
    shaped = {link.get("name", "") for link in root.findall("link") if link.find("collision") is not None}
    return Description(
        name=name,
        path=path,
        xml=ET.tostring(root, encoding="unicode"),
        limits=limits,
        moved=moved,
        missing=missing,
        notes=[*source.notes, *notes, *more, *(f"no inertia: {why}" for _, why in read.values() if why)],
        parents=tree.parents(shaped | set(missing)),
        may_touch=may_touch,
        mount=mount,
        planes=turned(source.planes, mount),
        home=home_among(group_states(path, name) if source.postures is None else source.postures, [*moved]),
        drives=described_drives(moving, where) if setup.friction else None,
        gravity=GRAVITY if source.gravity is None else math.hypot(*source.gravity),
    )


def _of_links(root: ET.Element, where: str, read: Callable[[ET.Element, str], T]) -> dict[str, T]:
    """Result of a function of each link, and of where it stands for messages, by its name."""
    names = {link.get("name", ""): link for link in root.findall("link")}
    return {name: read(link, f"{where}: link {name!r}") for name, link in names.items()}


def _touching(root: ET.Element, where: str) -> tuple[tuple[str, str, str], ...]:
    """Pairs of links that a description itself lets touch: `<disable_collisions>` as in an SRDF, and why."""
    found = []
    for pair in root.findall("disable_collisions"):
        one, other = (xml.attribute(pair, key, where) for key in ("link1", "link2"))
        found.append((one, other, pair.get("reason") or "the description"))
    return tuple(found)
