"""Geoms of a compiled MJCF as a URDF's collision shapes."""

import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import scipy  # its parts are imported when they are used
from numpy.typing import NDArray

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


def write_collision(link: ET.Element, model: mujoco.MjModel, geom: int) -> bool:
    """Write a geom as a collision shape, if it collides; false where a URDF has no such shape."""
    if not (model.geom_contype[geom] or model.geom_conaffinity[geom]):
        return True
    kind = _SHAPES.get(int(model.geom_type[geom]))
    if kind is None:
        return False
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
    element = ET.SubElement(link, "collision")
    origin = ET.SubElement(element, "origin")
    write_placement(origin, turn_of(model.geom_quat[geom]), model.geom_pos[geom])
    ET.SubElement(ET.SubElement(element, "geometry"), kind, sizes)
    return True


def turn_of(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation (3, 3) of a quaternion, scalar first."""
    return scipy.spatial.transform.Rotation.from_quat(np.roll(quaternion, -1)).as_matrix()
