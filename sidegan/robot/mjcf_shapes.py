"""Geoms of a compiled MJCF as a URDF's collision and visual shapes."""

import xml.etree.ElementTree as ET
from collections.abc import Iterable

import mujoco
import numpy as np
from numpy.typing import NDArray

from sidegan.robot.locking import write_placement
from sidegan.robot.meshes import kept_mesh

_SHAPES = {
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): "box",  # around it
    int(mujoco.mjtGeom.mjGEOM_MESH): "mesh",
}
_GROUPS = 3  # the first ones are those that MuJoCo's viewer shows


def write_collision(link: ET.Element, model: mujoco.MjModel, geom: int) -> bool:
    """Write a geom as a collision shape, if it collides; false where a URDF has no such shape."""
    if not (model.geom_contype[geom] or model.geom_conaffinity[geom]):
        return True
    return _write(link, model, geom, "collision") is not None


def write_visual(link: ET.Element, model: mujoco.MjModel, geom: int) -> None:
    """Write a geom with its colour as a visual shape, if MuJoCo shows it."""
    material = int(model.geom_matid[geom])
    plain = np.allclose(model.geom_rgba[geom], (0.5, 0.5, 0.5, 1.0))
    colour = model.mat_rgba[material] if material >= 0 and plain else model.geom_rgba[geom]
    if model.geom_group[geom] >= _GROUPS or not colour[3]:
        return
    visual = _write(link, model, geom, "visual")
    if visual is not None and (material >= 0 or not plain):
        ET.SubElement(ET.SubElement(visual, "material", name=""), "color", rgba=words(colour))


def _write(link: ET.Element, model: mujoco.MjModel, geom: int, tag: str) -> ET.Element | None:
    """Write a geom as a shape of some kind; None for what has no shape in a URDF."""
    kind = _SHAPES.get(int(model.geom_type[geom]))
    if kind is None:
        return None
    x, y, z = (float(size) for size in model.geom_size[geom])
    if kind == "mesh":  # as MuJoCo compiled it: scaled, and in its principal axes of inertia
        mesh = model.mesh(int(model.geom_dataid[geom]))
        vertices, faces = (
            data[int(first[0]) : int(first[0] + count[0])]
            for data, first, count in (
                (model.mesh_vert, mesh.vertadr, mesh.vertnum),
                (model.mesh_face, mesh.faceadr, mesh.facenum),
            )
        )
        sizes = {"filename": str(kept_mesh(vertices, faces))}
    elif kind == "box":
        sizes = {"size": words([2 * x, 2 * y, 2 * z])}
    else:
        sizes = {"radius": repr(x)} | ({} if kind == "sphere" else {"length": repr(2 * y)})
    element = ET.SubElement(link, tag)
    origin = ET.SubElement(element, "origin")
    write_placement(origin, turn_of(model.geom_quat[geom]), model.geom_pos[geom])
    ET.SubElement(ET.SubElement(element, "geometry"), kind, sizes)
    return element


def turn_of(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation (3, 3) of a quaternion, scalar first."""
    out = np.zeros(9)
    mujoco.mju_quat2Mat(out, quaternion / np.linalg.norm(quaternion))
    return out.reshape(3, 3)


def words(numbers: Iterable[float]) -> str:
    """Numbers as an attribute of XML."""
    return " ".join(repr(float(x)) for x in numbers)
