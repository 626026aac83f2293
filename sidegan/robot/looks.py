"""Looks of an arm: the visual shapes of its links as triangles."""

import logging
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sidegan.base.names import listed
from sidegan.errors import RobotError
from sidegan.robot import xml
from sidegan.robot.arm import Arm
from sidegan.robot.description import read_description
from sidegan.robot.locking import from_rpy
from sidegan.robot.meshes import find_mesh
from sidegan.robot.sources import read_source

if TYPE_CHECKING:  # slow to import
    import pinocchio as pin
    import trimesh

_log = logging.getLogger(__name__)
_CAPSULE = 8, 16  # rings of a capsule's half spheres, and points around it


class Part(NamedTuple):
    """A surface that moves with a joint."""

    link: int  # joint in whose frame it lies, 0..J-1; -1 is the base
    vertices: NDArray[np.float64]  # [m], (V, 3), in the joint's frame
    faces: NDArray[np.int64]  # (F, 3)


def visual_parts(arm: Arm, base: bool = False) -> list[Part]:
    """The visual shapes of an arm; the collision shapes of links that have no visual ones.

    What cannot be read is left out: pictures are no reason to fail. None where the file is no longer there.
    With ``base``, those of what stands still alone.
    """
    import pinocchio as pin  # takes a second to import

    from sidegan.robot.model import build

    try:
        description = read_description(arm.urdf, arm.setup, planning=False)
        model, root = build(description), read_source(arm.urdf, arm.setup.args).root
    except RobotError as error:
        _log.warning("%s is shown as its collision shapes alone: %s", arm.name, error)
        return []
    parts, unread = [], dict[str, str]()
    for link in root.findall("link"):
        name = link.get("name", "")
        index = model.getFrameId(name, pin.FrameType.BODY)
        if index == model.nframes or (base and model.frames[index].parentJoint):
            continue
        for visual in link.findall("visual") or link.findall("collision"):
            try:
                part = _part(arm.urdf, visual, model.frames[index])
            except Exception as error:  # readers of meshes raise whatever they like
                unread[name] = str(error)
                continue
            if len(part.faces) and np.isfinite(part.vertices).all():
                parts.append(part)
    if unread:
        why = next(iter(unread.values()))
        _log.info("%s: shapes that are not shown are of %s: %s", arm.name, listed(list(unread)), why)
    return parts


def _part(urdf: Path, visual: ET.Element, link: "pin.Frame") -> Part:
    """The surface of one shape in its joint's frame."""
    origin = visual.find("origin")
    shift = np.array(xml.vector(origin, "xyz", "a shape", "0 0 0"))
    turn = link.placement.rotation @ from_rpy(xml.vector(origin, "rpy", "a shape", "0 0 0"))
    shape = xml.child(visual, "geometry", "a shape")[0]
    surface = _mesh(shape, urdf) if shape.tag == "mesh" else _solid(shape)
    vertices = np.asarray(surface.vertices, float) @ turn.T + link.placement.act(shift)
    return Part(link.parentJoint - 1, vertices, np.asarray(surface.faces))


def _mesh(shape: ET.Element, urdf: Path) -> "trimesh.Trimesh":
    """Surfaces in a mesh file, in metres, as one."""
    import trimesh

    file = find_mesh(xml.attribute(shape, "filename", "a shape"), urdf)
    if file is None:
        raise RobotError(f"there is no file {shape.get('filename')}")
    scale = xml.vector(shape, "scale", "a shape", "1 1 1")
    return trimesh.load_scene(file, process=False).to_mesh().apply_scale(scale)


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
