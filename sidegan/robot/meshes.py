"""Mesh files: finding those of a description, reading them, and a cache of generated ones."""

import hashlib
import os
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from glob import escape
from pathlib import Path

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.cache import user_cache
from sidegan.base.storage import write_bytes
from sidegan.errors import ConfigError, RobotError
from sidegan.robot.xml import number_or_zero

_FEWEST = 4  # faces of a body
_DEEPEST = 3  # levels below an entry of ROS_PACKAGE_PATH that are searched for packages
_POINTER = b"version https://git-lfs"  # start of a Git LFS pointer, whose file was not downloaded
_SMALL = 100_000  # bytes; larger files surely have triangles
_TRIANGLES = (b"<triangles", b"<tristrips", b"<trifans", b"<polygons", b"<polylist")  # of Collada


def find_mesh(name: str, urdf: Path) -> Path | None:
    """The file of a mesh given as a path or as package://package/path; None if it does not exist.

    Relative paths are searched in the description's folder and those above it. A package is a folder of that
    name above the description or in one of those folders, on ROS_PACKAGE_PATH, or in the share folder of an
    entry of AMENT_PREFIX_PATH. Otherwise the path within the package is searched like a relative one, for
    descriptions that were copied without their package.
    """
    scheme, _, rest = name.rpartition("://")
    beside = (folder / rest for folder in urdf.parents)
    for file in beside if scheme in ("", "file") else _in_package(rest, urdf):
        try:
            if is_there(file):
                return file.resolve()
        except (OSError, ValueError):  # an invalid name, a forbidden folder
            continue
    return None


def is_there(file: Path) -> bool:
    """Whether a file exists and is not a Git LFS pointer."""
    if not file.is_file():
        return False
    with file.open("rb") as opened:
        return opened.read(len(_POINTER)) != _POINTER


def metres_per_unit(file: Path) -> float:
    """Metres per unit of a mesh file: as stated in Collada, 1 for other formats."""
    if file.suffix.lower() != ".dae":
        return 1.0
    stated = "1"
    try:
        with file.open("rb") as opened:
            for _, element in ET.iterparse(opened):
                kind = element.tag.rpartition("}")[2]
                if kind == "unit":
                    stated = element.get("meter", "1")
                if kind in ("unit", "asset"):  # geometry follows
                    break
    except (ET.ParseError, OSError, ValueError, LookupError):  # the last two of an encoding
        return 1.0  # reading its shape will report the error
    if (size := number_or_zero(stated)) <= 0:
        raise RobotError(f"mesh file {file} has the unit {stated!r}, expected a number of metres")
    return size


def has_surface(file: Path) -> bool:
    """Whether a mesh file has triangles, or is invalid."""
    import trimesh

    if not 0 < file.stat().st_size < _SMALL:
        return True
    if file.suffix.lower() == ".dae":
        return any(name in file.read_bytes() for name in _TRIANGLES)
    try:
        return len(trimesh.load_scene(file).to_mesh().faces) > 0
    except Exception:  # reading its shape will report the error
        return True


def read_mesh(file: Path) -> Array:
    """Vertices (V, 3) of a mesh file.

    Raises:
        ConfigError: when it cannot be read.
    """
    import trimesh

    try:
        mesh = trimesh.load_scene(file).to_mesh()
        if len(mesh.faces) < _FEWEST:
            raise ValueError("it has no closed surface")
        return np.asarray(mesh.vertices, float)
    except Exception as error:  # mesh readers raise all kinds of errors
        raise ConfigError(f"mesh file {file} cannot be read: {error}") from error


def cache_folder() -> Path:
    """Folder of ``SIDEGAN_CACHE``, or sidegan in the user's cache; a temporary one if it is not writable."""
    return user_cache() or Path(tempfile.gettempdir()) / "sidegan"


def kept_mesh(vertices: Array, faces: Array) -> Path:
    """Cached mesh file of vertices [m], (V, 3), and triangles (F, 3), named by its digest."""
    import trimesh
    from trimesh.exchange.stl import export_stl

    content = export_stl(trimesh.Trimesh(vertices, faces, process=False))
    file = cache_folder() / "meshes" / f"{hashlib.sha256(content).hexdigest()}.stl"
    if not (file.is_file() and file.read_bytes() == content):
        write_bytes(file, content)
    return file.resolve()


def _in_package(path: str, urdf: Path) -> Iterator[Path]:
    package, _, inside = path.partition("/")
    roots = _folders("ROS_PACKAGE_PATH")
    shares = (prefix / "share" for prefix in _folders("AMENT_PREFIX_PATH"))
    for folder in [*urdf.parents, *roots, *shares]:
        yield folder / package / inside
        if folder.name == package:
            yield folder / inside
    for root in roots if package else ():
        for depth in range(1, _DEEPEST + 1):
            yield from (found / inside for found in root.glob("*/" * depth + escape(package)))
    yield from (folder / inside for folder in urdf.parents)


def _folders(variable: str) -> list[Path]:
    return [Path(entry) for entry in os.environ.get(variable, "").split(os.pathsep) if entry]
