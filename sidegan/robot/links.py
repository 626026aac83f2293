"""Inertia and collision shapes of a URDF's links: checked, and put into words that Pinocchio reads."""

import os
import xml.etree.ElementTree as ET
from pathlib import Path

from sidegan.errors import RobotError
from sidegan.robot import xml

_SIZES = {  # of each shape: how many numbers each of its sizes has
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "box": {"size": 3},
    "mesh": {},
}


def check_inertia(link: ET.Element, where: str) -> None:
    """Raise unless a link's mass and inertia are finite numbers and its mass is not negative."""
    inertial = link.find("inertial")
    if inertial is None:
        return
    mass = xml.number(xml.child(inertial, "mass", where), "value", where)
    if mass < 0:
        raise RobotError(f"{where} has the mass {mass:g} kg, expected 0 or more")
    inertia = xml.child(inertial, "inertia", where)
    for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"):
        xml.number(inertia, key, where)
    for key in ("xyz", "rpy"):
        xml.vector(inertial.find("origin"), key, where, "0 0 0")


def prepare_shapes(link: ET.Element, path: Path, where: str) -> bool:
    """Whether all of a link's collision shapes can be had; those that cannot are taken out of the XML."""
    for visual in link.findall("visual"):
        link.remove(visual)
    complete = True
    for index, collision in enumerate(link.findall("collision")):
        shape = _checked_shape(collision, where)
        if shape.tag == "capsule":
            _write_as_marked_cylinder(link, collision, shape, f"capsule_{index}")
        elif shape.tag == "mesh" and not _resolve_mesh(shape, path, where):
            link.remove(collision)
            complete = False
    return complete


def _checked_shape(collision: ET.Element, where: str) -> ET.Element:
    """The shape of a collision element, of a known kind and with sizes above zero."""
    for key in ("xyz", "rpy"):
        xml.vector(collision.find("origin"), key, where, "0 0 0")
    geometry = xml.child(collision, "geometry", where)
    if len(geometry) != 1 or geometry[0].tag not in _SIZES:
        given = ", ".join(str(shape.tag) for shape in geometry) or "none"
        raise RobotError(f"{where} has a collision geometry of {given}, expected one of {', '.join(_SIZES)}")
    for key, size in _SIZES[geometry[0].tag].items():
        xml.positive(geometry[0], key, where, size)
    return geometry[0]


def _write_as_marked_cylinder(link: ET.Element, collision: ET.Element, shape: ET.Element, name: str) -> None:
    """Put a <capsule>, which some tools write, as Pinocchio has it: a cylinder that is marked as rounded."""
    shape.tag = "cylinder"
    collision.set("name", name)
    ET.SubElement(ET.SubElement(link, "collision_checking"), "capsule", name=name)


def _resolve_mesh(mesh: ET.Element, urdf: Path, where: str) -> bool:
    """Whether a mesh is beside the URDF, in a package above it or on the ROS paths; if so, write its path."""
    xml.vector(mesh, "scale", where, "1 1 1")
    scheme, _, rest = xml.attribute(mesh, "filename", where).rpartition("://")
    if scheme in ("", "file"):
        candidates = [urdf.parent / rest]
    else:
        package, _, inside = rest.partition("/")
        shares = [Path(entry) for entry in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if entry]
        prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
        shares += [Path(entry, "share") for entry in prefixes if entry]
        candidates = [folder / package / inside for folder in [*urdf.parents, *shares]]
        candidates += [folder / inside for folder in [*urdf.parents, *shares] if folder.name == package]
    file = next((file for file in candidates if file.is_file()), None)
    if file is not None:
        mesh.set("filename", str(file.resolve()))
    return file is not None
