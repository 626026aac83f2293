"""What an arm looks like: the visual shapes of its links as coloured triangles."""

import logging
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sidegan.base.names import listed
from sidegan.errors import RobotError
from sidegan.robot import xml
from sidegan.robot.arm import Arm
from sidegan.robot.chain import choose
from sidegan.robot.locking import from_rpy, lock
from sidegan.robot.meshes import find_mesh
from sidegan.robot.sources import read_source
from sidegan.robot.tree import Tree, read_tree

if TYPE_CHECKING:  # slow to import
    import trimesh

_log = logging.getLogger(__name__)
_CAPSULE = 8, 16  # rings of a capsule's half spheres, and points around it
Colour = tuple[float, float, float]  # red, green and blue, 0 to 1


class Part(NamedTuple):
    """A surface of one colour that moves with a joint."""

    link: int  # joint in whose frame it lies, 0..J-1; -1 is the base
    vertices: NDArray[np.float64]  # [m], (V, 3), in the joint's frame
    faces: NDArray[np.int64]  # (F, 3)
    colour: Colour | None  # None where nothing states one


class Placed(NamedTuple):
    """Where a link is: the joint that carries it, and its rotation (3, 3) and place [m] in that frame."""

    joint: int
    turn: NDArray[np.float64]
    place: NDArray[np.float64]


def visual_parts(arm: Arm, base: bool = False) -> list[Part]:
    """The visual shapes of an arm; the collision shapes of links that have no visual ones.

    What cannot be read is left out: pictures are no reason to fail. None where the file is no longer there.

    Args:
        arm: the arm.
        base: only of what stands still.
    """
    try:
        source = read_source(arm.urdf, arm.setup.args)
        root, where = source.root, str(arm.urdf)
        colours = _colours(root)
        for extra in [element for element in root if element.tag not in ("link", "joint")]:
            root.remove(extra)
        tree = read_tree(root, where, arm.setup.base)
        for name, value in choose(tree, arm.setup).locked.items():
            lock(tree.joints[name], value, tree.at(tree.joints[name]))
        places = [(link, _placed(arm, tree, link.get("name", ""))) for link in root.findall("link")]
        shown = [(link, placed) for link, placed in places if placed.joint < 0 or not base]
        unread: dict[str, str] = {}
        parts = [part for link, placed in shown for part in _link_parts(arm, link, placed, colours, unread)]
        if unread:
            why = next(iter(unread.values()))
            _log.info("%s: shapes that are not shown are of %s: %s", arm.name, listed(list(unread)), why)
        return parts
    except RobotError as error:
        _log.warning("%s is shown as its collision shapes alone: %s", arm.name, error)
        return []


def _link_parts(
    arm: Arm, link: ET.Element, placed: Placed, colours: dict[str, Colour], unread: dict[str, str]
) -> Iterator[Part]:
    """Surfaces of one link; why those that cannot be read are left out is put into ``unread``."""
    for visual in link.findall("visual") or link.findall("collision"):
        try:
            yield from _shape_parts(arm.urdf, visual, placed, _own_colour(visual, colours))
        except Exception as error:  # readers of meshes raise whatever they like
            unread[link.get("name", "")] = str(error)


def _placed(arm: Arm, tree: Tree, link: str) -> Placed:
    """Where a link is, once all joints but the arm's are fixed."""
    turn, place, carrier = from_rpy(arm.mount), np.zeros(3), -1
    for joint in tree.path(link):
        if joint.name in arm.joint_names:
            turn, place, carrier = np.eye(3), np.zeros(3), arm.joint_names.index(joint.name)
            continue
        local, shift = _origin(joint.element, tree.at(joint))
        turn, place = turn @ local, place + turn @ shift
    return Placed(carrier, turn, place)


def _origin(element: ET.Element, at: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotation (3, 3) and place [m], (3,), of an element's origin."""
    origin = element.find("origin")
    shift = np.array(xml.vector(origin, "xyz", at, "0 0 0"))
    return from_rpy(xml.vector(origin, "rpy", at, "0 0 0")), shift


def _shape_parts(urdf: Path, visual: ET.Element, placed: Placed, own: Colour | None) -> Iterator[Part]:
    """The surfaces of one shape in its joint's frame."""
    local, shift = _origin(visual, "a shape")
    turn, place = placed.turn @ local, placed.place + placed.turn @ shift
    shape = xml.child(visual, "geometry", "a shape")[0]
    is_mesh = shape.tag == "mesh"
    for surface in _meshes(shape, urdf) if is_mesh else [_solid(shape)]:
        vertices, faces = np.asarray(surface.vertices, float) @ turn.T + place, np.asarray(surface.faces)
        if len(faces) and np.isfinite(vertices).all():
            yield Part(placed.joint, vertices, faces, own or (_material_colour(surface) if is_mesh else None))


def _meshes(shape: ET.Element, urdf: Path) -> Iterator["trimesh.Trimesh"]:
    """Surfaces in a mesh file, in metres."""
    import trimesh

    file = find_mesh(xml.attribute(shape, "filename", "a shape"), urdf)
    if file is None:
        raise RobotError(f"there is no file {shape.get('filename')}")
    scale = xml.vector(shape, "scale", "a shape", "1 1 1")
    for surface in trimesh.load_scene(file, process=False).dump():
        if isinstance(surface, trimesh.Trimesh):
            yield surface.apply_scale(scale)


def _solid(shape: ET.Element) -> "trimesh.Trimesh":
    """A solid [m] in its own frame."""
    from trimesh import creation

    if shape.tag == "box":
        return creation.box(xml.positive(shape, "size", "a box", 3))
    (radius,) = xml.positive(shape, "radius", f"a {shape.tag}")
    if shape.tag == "sphere":
        return creation.icosphere(3, radius)
    (length,) = xml.positive(shape, "length", f"a {shape.tag}")
    return creation.cylinder(radius, length) if shape.tag == "cylinder" else creation.capsule(length, radius)


def capsule_surface(
    a: NDArray[np.float64], b: NDArray[np.float64], radius: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices [m], (V, 3), and triangles (F, 3) of a capsule around the segment from a to b [m]."""
    from trimesh import creation, geometry

    length = float(np.linalg.norm(b - a))
    made = creation.capsule(length, radius, _CAPSULE)
    if length > 0:
        made.apply_transform(geometry.align_vectors([0.0, 0.0, 1.0], b - a))
    return np.asarray(made.vertices) + (a + b) / 2, np.asarray(made.faces)


def _colours(root: ET.Element) -> dict[str, Colour]:
    """Colours that a description names, wherever it does."""
    return {
        material.get("name", ""): colour
        for material in root.iter("material")
        if (colour := _colour(material.find("color"))) is not None
    }


def _own_colour(visual: ET.Element, colours: dict[str, Colour]) -> Colour | None:
    """The colour that a description gives a shape."""
    material = visual.find("material")
    if material is None:
        return None
    return _colour(material.find("color")) or colours.get(material.get("name", ""))


def _colour(element: ET.Element | None) -> Colour | None:
    if element is None:
        return None
    try:
        red, green, blue, *_ = (min(max(float(x), 0.0), 1.0) for x in element.get("rgba", "").split())
    except ValueError:
        return None
    return red, green, blue


def _material_colour(surface: "trimesh.Trimesh") -> Colour | None:
    """The colour that a mesh file gives a surface."""
    material = getattr(surface.visual, "material", None)
    if material is None or getattr(material, "name", "") == "material_0":  # trimesh's own default
        return None
    red, green, blue = (float(x) / 255 for x in material.main_color[:3])
    return red, green, blue
