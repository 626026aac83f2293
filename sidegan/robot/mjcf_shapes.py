"""Conversion of a compiled MJCF's geoms to URDF shapes, and its planes."""

import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from sidegan.robot.arm import FilePlane
from sidegan.robot.locking import write_placement
from sidegan.robot.meshes import kept_mesh
from sidegan.robot.xml import words

_SHAPES = {
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): "box",  # around it
    int(mujoco.mjtGeom.mjGEOM_MESH): "mesh",
}
_HIDDEN = 3  # first group of geoms that MuJoCo's viewers hide by default


def write_shape(link: ET.Element, model: mujoco.MjModel, geom: int) -> bool:
    """Write a geom as a collision or visual shape, or both; False if URDF has no such shape."""
    kind = _SHAPES.get(int(model.geom_type[geom]))
    if kind is None:
        return False
    collides = bool(model.geom_contype[geom] or model.geom_conaffinity[geom])
    shown = model.geom_group[geom] < _HIDDEN and kind == "mesh"
    for tag in ["collision"] * collides + ["visual"] * (shown or not collides):
        _write(ET.SubElement(link, tag), kind, model, geom)
    return True


def plane_of(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> FilePlane | None:
    """Unit normal of a fixed plane and its offset along the normal [m]; None for other geoms."""
    plane = int(model.geom_type[geom]) == int(mujoco.mjtGeom.mjGEOM_PLANE)
    if not plane or model.body_weldid[model.geom_bodyid[geom]]:
        return None
    x, y, z = normal = data.geom_xmat[geom].reshape(3, 3)[:, 2].tolist()
    return x, y, z, float(data.geom_xpos[geom] @ normal)


def _write(element: ET.Element, kind: str, model: mujoco.MjModel, geom: int) -> None:
    """Write the origin and geometry of a shape."""
    x, y, z = (float(size) for size in model.geom_size[geom])
    if kind == "mesh":  # as MuJoCo compiled it: scaled, and in its principal axes of inertia
        mesh = model.mesh(int(model.geom_dataid[geom]))
        vertex, face = int(mesh.vertadr[0]), int(mesh.faceadr[0])
        vertices = model.mesh_vert[vertex : vertex + int(mesh.vertnum[0])]
        faces = model.mesh_face[face : face + int(mesh.facenum[0])]
        sizes = {"filename": str(kept_mesh(vertices, faces))}
    elif kind == "box":
        sizes = {"size": words([2 * x, 2 * y, 2 * z])}
    else:
        sizes = {"radius": repr(x)} | ({} if kind == "sphere" else {"length": repr(2 * y)})
    origin = ET.SubElement(element, "origin")
    write_placement(origin, turn_of(model.geom_quat[geom]), model.geom_pos[geom])
    ET.SubElement(ET.SubElement(element, "geometry"), kind, sizes)


def turn_of(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation (3, 3) from a quaternion, scalar first."""
    return pin.Quaternion(*quaternion).normalized().matrix()
