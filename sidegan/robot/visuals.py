"""Visual shapes of an arm's links as triangle meshes."""

import logging
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

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
from sidegan.robot.tree import read_tree

if TYPE_CHECKING:  # slow to import
    import trimesh

_log = logging.getLogger(__name__)
_FINE, _COARSE = (24, 32), (8, 16)  # rings of a round shape and points around it, of links and of capsules
_UP = np.array([0.0, 0.0, 1.0])
_FLAT = 1e-3  # [m] from z = 0 within which points belong to a foot


class Surface(NamedTuple):
    """A surface that moves with a joint."""

    link: int  # joint in whose frame it lies, 0..J-1; -1 is the base
    vertices: NDArray[np.float64]  # [m], (V, 3), in the joint's frame
    faces: NDArray[np.int64]  # (F, 3)


def visual_parts(arm: Arm) -> list[Surface]:
    """Visual shapes of an arm's links, or else collision shapes.

    Unreadable shapes are left out, since pictures are no reason to fail; all if the description is missing.
    """
    parts = []
    unread = dict[str, str]()
    for link, frame in _links(arm):
        for shape in link.findall("visual") or link.findall("collision"):
            try:
                parts.append(_part(arm, shape, frame))
            except Exception as error:  # mesh readers raise all kinds of errors
                unread[frame.name] = str(error)
    if unread:
        why = next(iter(unread.values()))
        _log.info("%s: some shapes of %s are not shown: %s", arm.name, listed(list(unread)), why)
    return [part for part in parts if len(part.faces)]


def foot(arm: Arm) -> tuple[float, bool, str]:
    """Lowest point of the fixed links [m], whether it is known, and the link that has it.

    A link ends at its visual shapes or its collision meshes, whichever end higher. Collision primitives only
    approximate a link, so z = 0 is assumed if they extend below it. Plugs and cables that hang beside a foot
    around the origin are ignored.
    """
    found = []
    for link, frame in _links(arm):
        solid, shown = link.findall("collision"), link.findall("visual")
        if frame.parentJoint or not (solid or shown):
            continue
        name = frame.name
        meshes = [shape for shape in solid if shape.find("geometry/mesh") is not None]
        if spans := [span for shapes in (shown, meshes) if (span := _span(arm, shapes, frame))]:
            found.append((max(low for low, _ in spans), True, name))
            continue
        low, high = _span(arm, [shape for shape in solid if shape not in meshes], frame) or (0.0, 0.0)
        found.append((0.0 if low < 0 < high else low, False, name))
    return min(found, default=(0.0, False, ""))


def like_the_arm(arm: Arm, link: str) -> bool:
    """Whether a link belongs to another limb with the same kinds of joints as the arm, as another leg."""
    tree = read_tree(read_source(arm.urdf, arm.setup.args).root, str(arm.urdf))
    paths = ([j for j in tree.path(end) if j.kind != "fixed"] for end in (link, arm.link_names[-1]))
    pair = next((pair for pair in zip(*paths) if pair[0] is not pair[1]), ())
    carried = [
        sorted(other.kind for other in tree.joints.values() if first in tree.path(other.child))
        for first in pair
    ]
    return len(carried) == 2 and carried[0] == carried[1]


def _span(arm: Arm, shapes: list[ET.Element], frame: pin.Frame) -> tuple[float, float] | None:
    """Lowest and highest point [m] of shapes; None if there are none or one is unreadable.

    The lowest is z = 0 if points there enclose the origin and all points below are on one side of it.
    """
    try:
        points = np.concatenate([_part(arm, shape, frame).vertices for shape in shapes])
        heights = points[:, 2]
        low, high = float(heights.min()), float(heights.max())
        at, below = points[np.abs(heights) <= _FLAT, :2], points[heights < -_FLAT, :2]
        return (0.0 if low < -_FLAT and _encloses(at) and not _encloses(below) else low), high
    except Exception:  # mesh readers raise all kinds of errors
        return None


def _encloses(points: NDArray[np.float64]) -> bool:
    """Whether points (N, 2) surround the origin: no gap between their directions is half a turn."""
    angles = np.sort(np.arctan2(points[:, 1], points[:, 0]))
    return len(angles) > 2 and bool(np.diff(angles, append=angles[0] + 2 * np.pi).max() < np.pi)


def _links(arm: Arm) -> Iterator[tuple[ET.Element, pin.Frame]]:
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


def _part(arm: Arm, visual: ET.Element, link: pin.Frame) -> Surface:
    """Surface of a shape in its joint's frame; shapes far too large or small for the arm are refused."""
    origin = visual.find("origin")
    shift = np.array(xml.vector(origin, "xyz", "a shape", "0 0 0"))
    turn = link.placement.rotation @ from_rpy(xml.vector(origin, "rpy", "a shape", "0 0 0"))
    shape = xml.child(visual, "geometry", "a shape")[0]
    surface = _surface(shape, arm.urdf)
    points = np.asarray(surface.vertices, float)
    size = float(np.linalg.norm(np.ptp(points, 0)))
    moves = bool(link.parentJoint)
    if why := of_another_order(size, length_of(vars(arm)), moves, shape.tag == "mesh"):
        raise RobotError(f"a shape is {why}")
    return Surface(
        link.parentJoint - 1, points @ turn.T + link.placement.act(shift), np.asarray(surface.faces)
    )


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
        half = np.array(xml.positive(shape, "size", at, 3)) / 2
        return trimesh.creation.box(bounds=[-half, half])
    (radius,) = xml.positive(shape, "radius", at)
    length = 0.0 if shape.tag == "sphere" else xml.positive(shape, "length", at)[0]
    if shape.tag == "cylinder":
        return trimesh.creation.cylinder(radius, length, sections=_FINE[1])
    return trimesh.creation.capsule(length, radius, count=_FINE)


def capsule_surface(
    a: NDArray[np.float64], b: NDArray[np.float64], radius: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Surface of a capsule around the segment from a to b [m]: vertices [m], (V, 3), and triangles (F, 3)."""
    import trimesh

    along = b - a if np.any(a != b) else _UP
    turn = pin.Quaternion.FromTwoVectors(_UP, along).toRotationMatrix()
    mesh = trimesh.creation.capsule(float(np.linalg.norm(b - a)), radius, count=_COARSE)
    return np.asarray(mesh.vertices) @ turn.T + (a + b) / 2, np.asarray(mesh.faces)
