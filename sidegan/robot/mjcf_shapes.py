"""Geoms of a compiled MJCF as a URDF's collision and visual shapes."""

import hashlib
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import scipy  # its parts are imported when they are used
from numpy.typing import NDArray

from sidegan.base.storage import write_bytes
from sidegan.errors import StorageError
from sidegan.robot.covers import cache_folder
from sidegan.robot.enclosing import around_points
from sidegan.robot.locking import write_placement

Vector = NDArray[np.float64]
_SHAPES = {
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): "box",  # around it
    int(mujoco.mjtGeom.mjGEOM_MESH): "mesh",
}
_FORMATS = (".stl", ".obj", ".dae")  # of meshes that Pinocchio reads
_GROUPS = 3  # the first ones are those that MuJoCo's viewer shows
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])  # of STL


class GeomWriter:
    """Writes the geoms of a model into a URDF's links.

    Args:
        model: the compiled model.
        path: its file, beside which its meshes are.
    """

    def __init__(self, model: mujoco.MjModel, path: Path) -> None:
        self.model, self.path = model, path

    def write_collision(self, link: ET.Element, geom: int) -> bool:
        """Write a geom as a collision shape, if it takes part in collisions; false where it cannot be."""
        model = self.model
        if not (model.geom_contype[geom] or model.geom_conaffinity[geom]):
            return True
        return self._write(link, geom, "collision") is not None

    def write_visual(self, link: ET.Element, geom: int) -> None:
        """Write a geom with its colour as a visual shape, if MuJoCo shows it."""
        model = self.model
        material = int(model.geom_matid[geom])
        plain = np.allclose(model.geom_rgba[geom], (0.5, 0.5, 0.5, 1.0))
        colour = model.mat_rgba[material] if material >= 0 and plain else model.geom_rgba[geom]
        if model.geom_group[geom] >= _GROUPS or not colour[3]:
            return
        visual = self._write(link, geom, "visual")
        if visual is not None and (material >= 0 or not plain):
            ET.SubElement(ET.SubElement(visual, "material", name=""), "color", rgba=words(colour))

    def _write(self, link: ET.Element, geom: int, tag: str) -> ET.Element | None:
        """Write a geom as a shape of some kind; None for what has no shape in a URDF."""
        model = self.model
        kind = _SHAPES.get(int(model.geom_type[geom]))
        if kind is None:
            return None
        turn, place = turn_of(model.geom_quat[geom]), model.geom_pos[geom].copy()
        x, y, z = (float(size) for size in model.geom_size[geom])
        element = ET.SubElement(link, tag)
        origin, shape = ET.SubElement(element, "origin"), ET.SubElement(element, "geometry")
        if kind == "sphere":
            ET.SubElement(shape, kind, radius=repr(x))
        elif kind in ("capsule", "cylinder"):
            ET.SubElement(shape, kind, radius=repr(x), length=repr(2 * y))
        elif kind == "box":
            ET.SubElement(shape, kind, size=words([2 * x, 2 * y, 2 * z]))
        else:
            turn, place = self._mesh(shape, int(model.geom_dataid[geom]), turn, place, tag == "collision")
        write_placement(origin, turn, place)
        return element

    def _mesh(
        self, shape: ET.Element, mesh: int, turn: Vector, place: Vector, convex: bool
    ) -> tuple[Vector, Vector]:
        """A mesh by its file, or by one that is made of its vertices; its rotation and place.

        MuJoCo collides the hulls of meshes: where there is no file, that is what a collision shape becomes.
        """
        model = self.model
        file = self._file(mesh)
        if file is not None:  # MuJoCo moved its vertices into the principal axes of inertia: undo that
            turn = turn @ turn_of(model.mesh_quat[mesh]).T
            place = place - turn @ model.mesh_pos[mesh]
            ET.SubElement(shape, "mesh", filename=str(file), scale=words(model.mesh_scale[mesh]))
            return turn, place
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        vertices = model.mesh_vert[first : first + count]
        first, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
        faces = _hull_faces(vertices) if convex else model.mesh_face[first : first + count]
        made = None if faces is None else _made(vertices[faces])
        if made is not None:
            ET.SubElement(shape, "mesh", filename=str(made))
            return turn, place
        (a, b), radius = around_points(vertices.astype(np.float64))
        length = float(np.linalg.norm(b - a))
        ET.SubElement(shape, "capsule", radius=repr(float(radius)), length=repr(max(length, 1e-9)))
        return turn @ _onto((b - a) / length if length else np.array([0.0, 0, 1])), place + turn @ (a + b) / 2

    def _file(self, mesh: int) -> Path | None:
        """The file that a mesh was read from, where Pinocchio can read it too."""
        address = self.model.mesh_pathadr[mesh]
        if address < 0:
            return None
        name = self.model.paths[address:].split(b"\0", 1)[0].decode()
        file = self.path.parent / name
        return file.resolve() if file.suffix.lower() in _FORMATS and file.is_file() else None


def _hull_faces(vertices: NDArray[np.float32]) -> NDArray[np.int32] | None:
    """Triangles of the vertices' hull, outwards, (F, 3); None of what lies in a plane."""
    try:
        hull = scipy.spatial.ConvexHull(vertices.astype(np.float64))
    except (scipy.spatial.QhullError, ValueError):
        return None
    a, b, c = (hull.points[hull.simplices[:, k]] for k in range(3))
    inwards = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(1) < 0
    return np.where(inwards[:, None], hull.simplices[:, ::-1], hull.simplices)


def _made(triangles: NDArray[np.float32]) -> Path | None:
    """A file of triangles (F, 3, 3) in the user's cache, under its digest; None where none can be written."""
    table = np.zeros(len(triangles), dtype=_TRIANGLE)
    table["corners"] = triangles
    content = bytes(80) + np.uint32(len(table)).tobytes() + table.tobytes()
    file = cache_folder() / "meshes" / f"{hashlib.sha256(content).hexdigest()}.stl"
    try:
        if not (file.is_file() and file.read_bytes() == content):
            write_bytes(file, content)
    except (OSError, StorageError):
        return None
    return file.resolve()


def turn_of(quaternion: Vector) -> Vector:
    """Rotation (3, 3) of a quaternion, scalar first."""
    out = np.zeros(9)
    mujoco.mju_quat2Mat(out, quaternion / np.linalg.norm(quaternion))
    return out.reshape(3, 3)


def _onto(direction: Vector) -> Vector:
    """A rotation (3, 3) that turns z into a unit vector."""
    quaternion = np.zeros(4)
    mujoco.mju_quatZ2Vec(quaternion, direction)
    return turn_of(quaternion)


def words(numbers: Vector | list[float]) -> str:
    """Numbers as an attribute of XML."""
    return " ".join(repr(float(x)) for x in numbers)
