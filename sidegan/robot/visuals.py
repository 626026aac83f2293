"""Visual shapes of an arm's links as triangle meshes."""

import logging
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.errors import RobotError
from sidegan.robot import xml
from sidegan.robot.arm import Arm, length_of
from sidegan.robot.collision import of_another_order
from sidegan.robot.description import read_description
from sidegan.robot.meshes import find_mesh, metres_per_unit
from sidegan.robot.model import pinocchio_model
from sidegan.robot.placement import from_rpy
from sidegan.robot.sources import read_source

if TYPE_CHECKING:  # slow to import
    import trimesh

_log = logging.getLogger(__name__)
_FINE, _COARSE = (24, 32), (8, 16)  # rings of a round shape and points around it, of links and of capsules
_UP = np.array([0.0, 0.0, 1.0])


class Surface(NamedTuple):
    """A surface that moves with a joint."""

    link: int  # joint in whose frame it lies, 0..J-1; -1 is the base
    vertices: Array  # [m], (V, 3), in the joint's frame
    faces: Array  # (F, 3)


def visual_parts(arm: Arm) -> list[Surface]:
    """Visual shapes of an arm's links, or else collision shapes.

    Unreadable shapes are left out, since pictures are no reason to fail; all if the description is missing.
    """
    parts = []
    unread = dict[str, str]()
    for link, frame in links_with_frames(arm):
        for shape in link.findall("visual") or link.findall("collision"):
            try:
                parts.append(read_surface(arm, shape, frame))
            except Exception as error:  # mesh readers raise all kinds of errors
                unread[frame.name] = str(error)
    if unread:
        why = next(iter(unread.values()))
        _log.info("%s: some shapes of %s are not shown: %s", arm.name, listed(list(unread)), why)
    return [part for part in parts if len(part.faces)]


def links_with_frames(arm: Arm) -> Iterator[tuple[ET.Element, pin.Frame]]:
    """The description's links and their frames; none if the file is missing."""
    try:
        description = read_description(arm.urdf, arm.setup, planning=False)
        model = pinocchio_model(description)
        root = read_source(arm.urdf, arm.setup.args).root
    except RobotError as error:
        _log.warning("%s is shown with its collision shapes only: %s", arm.name, error)
        return
    for link in root.findall("link"):
        index = model.getFrameId(link.get("name", ""), pin.FrameType.BODY)
        if index < model.nframes:
            yield link, model.frames[index]


def read_surface(arm: Arm, visual: ET.Element, link: pin.Frame) -> Surface:
    """Surface of a shape in its joint's frame; shapes far too large or small for the arm are refused."""
    xyz, rpy = xml.origin(visual, "a shape")
    turn = link.placement.rotation @ from_rpy(rpy)
    shape = xml.child(visual, "geometry", "a shape")[0]
    surface = _surface(shape, arm.urdf)
    points = np.asarray(surface.vertices, float)
    size = float(np.linalg.norm(np.ptp(points, 0)))
    moves = bool(link.parentJoint)
    if why := of_another_order(size, length_of(vars(arm)), moves, shape.tag == "mesh"):
        raise RobotError(f"a shape is {why}")
    place = link.placement.act(np.array(xyz))
    return Surface(link.parentJoint - 1, points @ turn.T + place, np.asarray(surface.faces))


def _surface(shape: ET.Element, urdf: Path) -> "trimesh.Trimesh":
    """Surface of a shape, in its own frame; all surfaces of a mesh file as one."""
    import trimesh

    at = f"a {shape.tag}"
    if shape.tag == "mesh":
        file = find_mesh(xml.attribute(shape, "filename", at), urdf)
        if file is None:
            raise RobotError(f"there is no file {shape.get('filename')}")
        scale = metres_per_unit(file) * np.array(xml.vector(shape, "scale", at, "1 1 1"))
        return trimesh.load_scene(file, process=False).to_mesh().apply_scale(scale)
    if shape.tag == "box":
        return trimesh.creation.box(xml.positive(shape, "size", at, 3))
    (radius,) = xml.positive(shape, "radius", at)
    length = 0.0 if shape.tag == "sphere" else xml.positive(shape, "length", at)[0]
    if shape.tag == "cylinder":
        return trimesh.creation.cylinder(radius, length, sections=_FINE[1])
    return trimesh.creation.capsule(length, radius, count=_FINE)


def capsule_surface(a: Array, b: Array, radius: float) -> tuple[Array, Array]:
    """Surface of a capsule around the segment from a to b [m]: vertices [m], (V, 3), and triangles (F, 3)."""
    import trimesh

    along = b - a if np.any(a != b) else _UP
    turn = pin.Quaternion.FromTwoVectors(_UP, along).toRotationMatrix()
    mesh = trimesh.creation.capsule(float(np.linalg.norm(b - a)), radius, count=_COARSE)
    return np.asarray(mesh.vertices) @ turn.T + (a + b) / 2, np.asarray(mesh.faces)
