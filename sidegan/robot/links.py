"""Inertia and collision shapes of a URDF's links, checked and rewritten for Pinocchio."""

import xml.etree.ElementTree as ET
from pathlib import Path

from sidegan.errors import RobotError
from sidegan.robot import xml
from sidegan.robot.meshes import find_mesh, has_surface, metres_per_unit

_SIZES = {  # attributes of each shape's sizes, and how many numbers each has
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "box": {"size": 3},
    "mesh": {},
}


def read_mass(link: ET.Element, where: str) -> tuple[float, str]:
    """Mass of a link [kg], 0 without inertia, and why an invalid inertia was removed from the XML, if so."""
    inertial = link.find("inertial")
    if inertial is None:
        return 0.0, ""
    try:
        mass = xml.number(xml.child(inertial, "mass", where), "value", where)
        if mass < 0:
            raise RobotError(f"{where} has the mass {mass:g} kg, expected 0 or more")
        inertia = xml.child(inertial, "inertia", where)
        for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"):
            xml.number(inertia, key, where)
        for key in ("xyz", "rpy"):
            xml.vector(inertial.find("origin"), key, where, "0 0 0")
    except RobotError as error:
        link.remove(inertial)
        return 0.0, str(error)
    return mass, ""


def prepare_shapes(link: ET.Element, path: Path, where: str, meshes: bool) -> list[str]:
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


def _checked_shape(collision: ET.Element, where: str) -> ET.Element:
    """The shape of a collision element, of a known kind and with positive sizes."""
    for key in ("xyz", "rpy"):
        xml.vector(collision.find("origin"), key, where, "0 0 0")
    geometry = xml.child(collision, "geometry", where)
    if len(geometry) != 1 or geometry[0].tag not in _SIZES:
        given = ", ".join(str(shape.tag) for shape in geometry) or "none"
        raise RobotError(f"{where} has a collision geometry of {given}, expected one of {', '.join(_SIZES)}")
    for key, size in _SIZES[geometry[0].tag].items():
        xml.positive(geometry[0], key, where, size)
    return geometry[0]
