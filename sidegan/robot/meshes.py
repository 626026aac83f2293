"""Mesh files: where those are that a description names, what is in them, and a cache of made ones."""

import hashlib
import os
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from glob import escape
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sidegan.base.storage import write_bytes
from sidegan.errors import ConfigError, RobotError

VARIABLE = "SIDEGAN_CACHE"  # environment variable that names the folder of the cache

_FEWEST = 4  # faces of a body
_DEEPEST = 3  # folders below an entry of ROS_PACKAGE_PATH that a package is looked for in
_POINTER = b"version https://git-lfs"  # how a file begins that stands for one which was not downloaded
_SMALL = 100_000  # bytes; a larger file has triangles
_TRIANGLES = (b"<triangles", b"<tristrips", b"<trifans", b"<polygons", b"<polylist")  # in Collada


def find_mesh(name: str, urdf: Path) -> Path | None:
    """The file that is meant by a path or by package://package/path; None where it is not there.

    Relative paths are looked for beside the description and in the folders above it. A package is a folder of
    that name above the description or in one of those folders, on ROS_PACKAGE_PATH, or in the share folder of
    an entry of AMENT_PREFIX_PATH; failing that, the path within the package is looked for as a relative one,
    for descriptions that were copied without their package.
    """
    scheme, _, rest = name.rpartition("://")
    candidates = _relative(rest, urdf) if scheme in ("", "file") else _in_package(rest, urdf)
    for file in candidates:
        try:
            if is_there(file):
                return file.resolve()
        except (OSError, ValueError):  # a name that is none, a forbidden folder
            continue
    return None


def is_there(file: Path) -> bool:
    """Whether a file is there, and none that stands for one which was not downloaded."""
    if not file.is_file():
        return False
    with file.open("rb") as opened:
        return opened.read(len(_POINTER)) != _POINTER


def metres_per_unit(file: Path) -> float:
    """Metres per unit of a mesh file: as Collada states it, and 1 of other formats."""
    if file.suffix.lower() != ".dae":
        return 1.0
    stated = "1"
    try:
        with file.open("rb") as opened:
            for _, element in ET.iterparse(opened, ("start",)):
                kind = element.tag.rpartition("}")[2]
                if kind == "unit":
                    stated = element.get("meter", "1")
                if kind == "unit" or kind.startswith("library_"):  # where geometry begins
                    break
        if not 0 < (size := float(stated)) < float("inf"):
            raise ValueError
    except (ET.ParseError, OSError):
        return 1.0  # readers of its shape say what is wrong with it
    except ValueError:
        raise RobotError(f"mesh file {file} has the unit {stated!r}, expected a number of metres") from None
    return size


def has_surface(file: Path) -> bool:
    """Whether a mesh file has triangles: false of one that is sound and has none."""
    import trimesh

    if not 0 < file.stat().st_size < _SMALL:
        return True
    if file.suffix.lower() == ".dae":
        return any(name in file.read_bytes() for name in _TRIANGLES)
    try:
        return len(trimesh.load_scene(file).to_mesh().faces) > 0
    except Exception:  # whatever is wrong with it, whoever needs its shape says so
        return True


def read_mesh(file: Path) -> NDArray[np.float64]:
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
    except Exception as error:  # readers of meshes raise whatever they like
        raise ConfigError(f"mesh file {file} cannot be read: {error}") from error


def cache_folder() -> Path:
    """Folder of ``SIDEGAN_CACHE``, or sidegan in the user's cache; a temporary one where it is read-only."""
    usual = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "sidegan"
    folder = Path(os.environ.get(VARIABLE) or usual)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return Path(tempfile.gettempdir()) / "sidegan"
    return folder if os.access(folder, os.W_OK) else Path(tempfile.gettempdir()) / "sidegan"


def kept_mesh(vertices: NDArray[np.floating], faces: NDArray[np.integer]) -> Path:
    """A file of vertices [m], (V, 3), and triangles (F, 3) in the cache, under its digest."""
    import trimesh
    from trimesh.exchange.stl import export_stl

    content = export_stl(trimesh.Trimesh(vertices, faces, process=False))
    file = cache_folder() / "meshes" / f"{hashlib.sha256(content).hexdigest()}.stl"
    if not (file.is_file() and file.read_bytes() == content):
        write_bytes(file, content)
    return file.resolve()


def _relative(path: str, urdf: Path) -> Iterator[Path]:
    return (folder / path for folder in urdf.parents)


def _in_package(path: str, urdf: Path) -> Iterator[Path]:
    package, _, inside = path.partition("/")
    roots = _folders("ROS_PACKAGE_PATH")
    for folder in [*urdf.parents, *roots, *(one / "share" for one in _folders("AMENT_PREFIX_PATH"))]:
        yield folder / package / inside
        if folder.name == package:
            yield folder / inside
    for root in roots if package else ():
        for depth in range(1, _DEEPEST + 1):
            yield from (found / inside for found in root.glob("*/" * depth + escape(package)))
    yield from _relative(inside, urdf)


def _folders(variable: str) -> list[Path]:
    return [Path(entry) for entry in os.environ.get(variable, "").split(os.pathsep) if entry]
