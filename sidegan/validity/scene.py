"""MoveIt's planning scenes (.scene files) as keep-out regions."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import scipy  # its parts are imported when they are used
from numpy.typing import NDArray

from sidegan.errors import ConfigError
from sidegan.validity.obstacles import Convex, Sphere
from sidegan.validity.regions import Plane, Region

_LARGEST = 50_000_000  # bytes
_MOST = 1_000  # objects

Numbers = NDArray[np.float64]


def read_scene(path: Path) -> list[Region]:
    """The obstacles of a planning scene.

    Boxes, spheres, cylinders, cones, planes and meshes, of which the convex hull counts. What is on the
    negative side of a plane is kept out of. Both forms of such files are read: with a pose of each object, as
    MoveIt has written them since 2020, and without.

    Raises:
        ConfigError: when the file cannot be read, or is no scene.
    """
    try:
        if path.stat().st_size > _LARGEST:
            raise ConfigError(f"workspace.scene: {path} is larger than {_LARGEST / 1e6:.0f} MB")
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as error:
        raise ConfigError(f"workspace.scene: {path} cannot be read: {error.strerror}") from error
    starts = [k for k, line in enumerate(lines) if line.startswith("*")]
    if not starts and "." not in (line.strip() for line in lines):
        raise ConfigError(f"workspace.scene: {path} is no MoveIt scene: it has neither objects nor an end")
    if len(starts) > _MOST:
        raise ConfigError(f"workspace.scene: {path} has {len(starts)} objects, expected at most {_MOST}")
    regions: list[Region] = []
    for first, last in zip(starts, [*starts[1:], len(lines)]):
        name = lines[first][1:].strip()
        try:
            regions += _object(lines[first + 1 : last])
        except (ValueError, IndexError, StopIteration, ConfigError) as error:
            raise ConfigError(
                f"workspace.scene: object {name!r} of {path}: {str(error) or 'it ends early'}"
            ) from error
    return regions


def _object(lines: list[str]) -> list[Region]:
    """The shapes of an object, from the lines below its name."""
    words = iter(" ".join(lines).split())
    posed = bool(lines) and len(lines[0].split()) > 1
    whole = _pose(words) if posed else (np.eye(3), np.zeros(3))
    return [_shape(words, *whole) for _ in range(_count(words))]


def _count(words: Iterator[str]) -> int:
    """The next word as a number of things."""
    count = int(next(words))
    if not 0 <= count <= _LARGEST:
        raise ValueError(f"{count} of something, expected 0 or more")
    return count


def _numbers(words: Iterator[str], count: int) -> Numbers:
    """The next words as finite numbers."""
    found = np.array([float(next(words)) for _ in range(count)])
    if not np.isfinite(found).all():
        raise ValueError(f"{found.tolist()} are not finite")
    return found


def _pose(words: Iterator[str]) -> tuple[Numbers, Numbers]:
    """Rotation (3, 3) and place [m], of a place and a quaternion, scalar last."""
    place, quaternion = _numbers(words, 3), _numbers(words, 4)
    if np.linalg.norm(quaternion) < 1e-6:
        raise ValueError("a quaternion is zero")
    return scipy.spatial.transform.Rotation.from_quat(quaternion).as_matrix(), place


def _shape(words: Iterator[str], whole: Numbers, origin: Numbers) -> Region:
    """One shape, placed in its object, which has this rotation (3, 3) and place [m]."""
    kind = next(words)
    match kind:
        case "box":
            body: Convex | Numbers = Convex.box(_numbers(words, 3).tolist())
        case "sphere":
            body = _numbers(words, 1)
        case "cylinder" | "cone":
            radius, length = _numbers(words, 2)
            body = Convex.cylinder(radius, length, 0.0 if kind == "cone" else 1.0)
        case "plane":
            body = _numbers(words, 4)
        case "mesh":
            corners, triangles = _count(words), _count(words)
            body = Convex.around(_numbers(words, 3 * corners).reshape(-1, 3))
            _numbers(words, 3 * triangles)
        case _:
            raise ValueError(f"a shape is {kind!r}, expected box, sphere, cylinder, cone, plane or mesh")
    turn, place = _pose(words)
    _numbers(words, 4)  # its colour
    turn, place = whole @ turn, origin + whole @ place
    if isinstance(body, Convex):
        return body.placed(turn, place)
    x, y, z = place.tolist() if kind == "sphere" else (turn @ body[:3]).tolist()
    if kind == "sphere":
        return Sphere((x, y, z), float(body[0]))
    normal = np.array([x, y, z])
    return Plane((x, y, z), float(normal @ place - body[3]) / max(float(np.linalg.norm(normal)), 1e-300))
