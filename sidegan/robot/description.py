"""Reading and checking of a description, reduced to what the physics needs, before Pinocchio parses it."""

import copy
import math
import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sidegan.base.arrays import Array, numbers
from sidegan.base.names import listed
from sidegan.base.settings_text import setting_name
from sidegan.errors import RobotError, ShapeError
from sidegan.robot import xml
from sidegan.robot.arm import NO_INERTIA, FilePlane
from sidegan.robot.chain import choose_chain, describe_fixed
from sidegan.robot.drives import Drives
from sidegan.robot.limits import limits_of
from sidegan.robot.meshes import find_mesh, has_surface, metres_per_unit
from sidegan.robot.placement import GRAVITY, hang, lock, mount_of, rotate_planes, unit_axis
from sidegan.robot.setup import PLAIN, Mount, Setup
from sidegan.robot.sources import read_source
from sidegan.robot.tree import Tree, UrdfJoint, read_tree
from sidegan.robot.units import refuse_angles

_HOMES = "home", "ready"  # names of home postures, in order of preference
_SIZES = {  # attributes of each shape's sizes, and how many numbers each has
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "box": {"size": 3},
    "mesh": {},
}
_DYNAMICS = "damping", "friction", "armature"  # attributes of <dynamics>; the last only from an MJCF
_FOLDERS = ".", "../srdf", "../config"  # of SRDF files, relative to the URDF's folder


@dataclass(frozen=True)
class Description:
    """Description of an arm, before Pinocchio parses it."""

    name: str  # the robot's name
    path: Path
    xml: str  # a URDF of the arm without visual shapes, with absolute mesh paths
    moved: dict[str, str]  # child link by moving joint, from the base outwards
    limits: dict[str, Array]  # of these joints, (J,), named as in `Arm`
    missing: dict[str, list[str]]  # missing or empty mesh files by link
    notes: list[str]  # for people, on what was decided for them
    passive: list[str]  # forces on moving joints that are left out
    parents: frozenset[tuple[str, str]]  # links, each with its nearest ancestor that has a shape
    may_touch: tuple[tuple[str, str, str], ...]  # pairs of links not checked for collision, and the source
    mount: Mount  # roll, pitch and yaw [rad] of the first link, in a world whose z points up
    planes: tuple[FilePlane, ...]  # in that world
    gravity: float  # [m/s²], downwards
    home: tuple[float, ...] | None  # of the moving joints [rad or m]
    drives: Drives | None  # stated friction and rotors, unless the setup ignores them


def read_description(
    path: Path, setup: Setup = PLAIN, home: Sequence[float] | None = None, planning: bool = True
) -> Description:
    """A checked description of an arm; see `load_robot` for arguments."""
    source = read_source(path, setup.args)
    root = source.root
    where = str(path)
    robot = root.get("name") or path.stem
    root.set("name", robot)
    may_touch = _touching(root, where)
    tree = read_tree(root, where)
    refuse_angles(root, where)
    for extra in tree.extras:
        root.remove(extra)
    moving, locked = choose_chain(tree, setup)
    for joint in moving:
        unit_axis(joint)
    links = {link.get("name", ""): link for link in root.findall("link")}
    read = {link: _read_mass(element, f"{where}: link {link!r}") for link, element in links.items()}
    masses = {link: mass for link, (mass, _) in read.items()}
    notes = describe_fixed(tree, moving, locked, masses)
    for name, value in locked.items():
        lock(tree.joints[name], value)
    moved = {joint.name: joint.child for joint in moving}
    wrong = [why for _, why in read.values() if why] or _massless(tree, links, moved, masses)
    postures = _group_states(path, robot) if source.postures is None else source.postures
    own_home = _home_among(postures, [*moved])
    around = own_home
    if home is not None:
        around = tuple(numbers(home, "home").ravel().tolist())
        if len(around) != len(moved) or not all(map(math.isfinite, around)):
            raise ShapeError(f"home position {home} must be {len(moved)} finite joint positions")
    middle = dict(zip(moved, around or ()))
    limits, assumed = limits_of(tree, moving, setup.limits, middle, planning)
    for pair in setup.may_touch or ():
        for link in pair:
            tree.require_link(link)
        may_touch += ((*pair, "robot.may_touch"),)
    missing = dict(source.missing if planning else {})
    path_joints = tree.path(moving[-1].child)
    on_chain = {joint.parent for joint in path_joints} | {joint.child for joint in path_joints}
    for link, element in links.items():
        # Surroundings, such as a fixed table, may have several shapes in one geometry, but neither the arm's
        # links nor what the last one carries.
        if link not in on_chain and moving[-1] not in tree.path(link):
            _separate(element)
        if absent := _prepare_shapes(element, path, f"{where}: link {link!r}", meshes=planning):
            missing[link] = absent
    mount = mount_of(setup.mount, source.gravity)
    if any(mount):
        hang(root, tree.root, mount)
        notes.append(f"mounted with roll {mount[0]:.4g}, pitch {mount[1]:.4g} and yaw {mount[2]:.4g} rad")
    if source.gravity is not None and not any(source.gravity):
        how = setting_name("robot.mount")
        notes.append(
            f"the file switches gravity off: {GRAVITY} m/s² is assumed; {how} says which way is down"
        )
    shaped = {link for link, element in links.items() if element.find("collision") is not None}
    acting = {what: [joint for joint in moved if joint in on] for what, on in source.passive.items()}
    return Description(
        name=robot,
        path=path,
        xml=ET.tostring(root, encoding="unicode"),
        limits=limits,
        moved=moved,
        missing=missing,
        notes=[*source.notes, *notes, *assumed, *(NO_INERTIA + why for why in wrong)],
        passive=[f"{what} at {listed(on)}" for what, on in acting.items() if on],
        parents=tree.parents(shaped | set(missing)),
        may_touch=may_touch,
        mount=mount,
        planes=rotate_planes(source.planes, mount),
        home=own_home,
        drives=_described_drives(moving) if setup.friction else None,
        gravity=math.hypot(*(source.gravity or ())) or GRAVITY,
    )


def _read_mass(link: ET.Element, where: str) -> tuple[float, str]:
    """Mass of a link [kg], 0 without inertia, and why an invalid inertia was removed from the XML, if so."""
    inertial = link.find("inertial")
    if inertial is None:
        return 0.0, ""
    try:
        mass = xml.scalar(xml.child(inertial, "mass", where), "value", where)
        if mass < 0:
            raise RobotError(f"{where} has the mass {mass:g} kg, expected 0 or more")
        inertia = xml.child(inertial, "inertia", where)
        for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"):
            xml.scalar(inertia, key, where)
        xml.origin(inertial, where)
    except RobotError as error:
        link.remove(inertial)
        return 0.0, str(error)
    return mass, ""


def _massless(
    tree: Tree, links: Mapping[str, ET.Element], moved: Mapping[str, str], masses: Mapping[str, float]
) -> list[str]:
    """Why no link that these joints move has a mass [kg]; empty if one has."""
    heavy = [link for link, mass in masses.items() if mass > 0]
    if any(joint.name in moved for link in heavy for joint in tree.path(link)):
        return []
    if heavy:
        return [f"only links that do not move have a mass: {listed(heavy)}"]
    stated = any(link.find("inertial") is not None for link in links.values())
    return ["every <inertial> has a mass of 0 kg" if stated else "the description has no <inertial>"]


def _prepare_shapes(link: ET.Element, path: Path, where: str, meshes: bool) -> list[str]:
    """Missing or empty mesh files of a link's collision shapes, which are removed from the XML.

    Scales of the others are converted to metres per unit of the file. Without ``meshes``, all meshes are
    removed, and none counts as missing.
    """
    for visual in link.findall("visual"):
        link.remove(visual)
    absent = []
    for index, collision in enumerate(link.findall("collision")):
        if not meshes and collision.find("geometry/mesh") is not None:
            link.remove(collision)
            continue
        shape = _checked_shape(collision, where)
        if shape.tag == "capsule":  # Pinocchio wants a cylinder that is marked as a capsule
            shape.tag = "cylinder"
            name = f"capsule_{index}"
            collision.set("name", name)
            ET.SubElement(ET.SubElement(link, "collision_checking"), "capsule", name=name)
        elif shape.tag == "mesh":
            scale = xml.vector(shape, "scale", where, "1 1 1")
            file = find_mesh(name := xml.attribute(shape, "filename", where), path)
            if file is None or not has_surface(file):
                link.remove(collision)
                absent.append(name if file is None else f"a surface in {name}")
            else:
                shape.set("filename", str(file))
                shape.set("scale", xml.words(metres_per_unit(file) * x for x in scale))
    return absent


def _separate(link: ET.Element) -> None:
    """Give each of several shapes in one geometry its own collision element."""
    for collision in link.findall("collision"):
        for geometry in collision.findall("geometry"):
            for shape in geometry[1:]:
                geometry.remove(shape)
                twin = copy.deepcopy(collision)
                twin.findall("geometry")[0][:] = [shape]
                link.append(twin)


def _checked_shape(collision: ET.Element, where: str) -> ET.Element:
    """The shape of a collision element, of a known kind and with positive sizes."""
    xml.origin(collision, where)
    geometry = xml.child(collision, "geometry", where)
    if len(geometry) != 1 or geometry[0].tag not in _SIZES:
        given = ", ".join(str(shape.tag) for shape in geometry) or "none"
        raise RobotError(f"{where} has a collision geometry of {given}, expected one of {', '.join(_SIZES)}")
    for key, size in _SIZES[geometry[0].tag].items():
        xml.positive(geometry[0], key, where, size)
    return geometry[0]


def _touching(root: ET.Element, where: str) -> tuple[tuple[str, str, str], ...]:
    """Pairs of links in `<disable_collisions>` elements, as in an SRDF, and the reasons."""
    found = []
    for pair in root.findall("disable_collisions"):
        first, second = (xml.attribute(pair, key, where) for key in ("link1", "link2"))
        found.append((first, second, pair.get("reason") or "the description"))
    return tuple(found)


def _home_among(
    postures: Mapping[str, Mapping[str, float]], joints: Sequence[str]
) -> tuple[float, ...] | None:
    """Joint positions [rad or m], (J,), of the home posture, or of the only one; otherwise None."""
    whole = {name.lower(): x for name, x in postures.items() if set(joints) <= set(x)}
    named = [whole[name] for name in _HOMES if name in whole]
    found = named or ([*whole.values()] if len(whole) == 1 else [])
    return tuple(found[0][joint] for joint in joints) if found else None


def _group_states(urdf: Path, robot: str) -> dict[str, dict[str, float]]:
    """Postures of a robot by name, from all groups in its SRDF files near the URDF."""
    found = defaultdict[str, dict[str, float]](dict)
    for file in [file for folder in _FOLDERS for file in sorted((urdf.parent / folder).glob("*.srdf"))]:
        try:
            root = ET.parse(file).getroot()
        except (ET.ParseError, OSError, ValueError, LookupError):  # the last two of an encoding
            continue
        for state in root.findall("group_state") if root.get("name") == robot else ():
            for joint in state.findall("joint"):
                with suppress(ValueError):  # of joints with several degrees of freedom
                    if math.isfinite(value := float(joint.get("value", ""))):
                        found[state.get("name", "")][joint.get("name", "")] = value
    return found


def _described_drives(moving: Sequence[UrdfJoint]) -> Drives | None:
    """Friction and rotor inertia of moving joints in a description; None if it states none."""
    rows = [[max(joint.number("dynamics", key), 0.0) for key in _DYNAMICS] for joint in moving]
    columns = np.array(rows, dtype=float).T
    return Drives(*columns) if columns.any() else None
