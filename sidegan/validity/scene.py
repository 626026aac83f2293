"""MoveIt's planning scenes (.scene files) as keep-out regions."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sidegan.errors import ConfigError
from sidegan.validity.obstacles import Convex, Sphere
from sidegan.validity.regions import Plane, Region

_LARGEST = 50_000_000  # bytes
_MOST = 1_000  # objects

Numbers = NDArray[np.float64]
Pose = tuple[Numbers, Numbers]  # rotation (3, 3), place [m]


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
                f"workspace.scene: object {name!r} of {path}: {error or 'it ends early'}"
            ) from error
    return regions


def _object(lines: list[str]) -> list[Region]:
    """The shapes of an object, from the lines below its name."""
    words = _Words(" ".join(lines).split())
    posed = bool(lines) and len(lines[0].split()) > 1
    whole = words.pose() if posed else (np.eye(3), np.zeros(3))
    return [_shape(words, whole) for _ in range(words.count())]


class _Words:
    """Numbers and names one after the other."""

    def __init__(self, words: list[str]) -> None:
        self._words: Iterator[str] = iter(words)

    def name(self) -> str:
        """The next word."""
        word = next(self._words, None)
        if word is None:
            raise ValueError("it ends early")
        return word

    def count(self) -> int:
        """The next word as a number of things."""
        count = int(self.name())
        if not 0 <= count <= _LARGEST:
            raise ValueError(f"{count} of something, expected 0 or more")
        return count

    def numbers(self, count: int) -> Numbers:
        """The next words as finite numbers."""
        found = np.array([float(self.name()) for _ in range(count)])
        if not np.isfinite(found).all():
            raise ValueError(f"{found.tolist()} are not finite")
        return found

    def pose(self) -> Pose:
        """A place and a quaternion, scalar last."""
        place, (x, y, z, w) = self.numbers(3), self.numbers(4)
        length = float(np.linalg.norm([x, y, z, w]))
        if length < 1e-6:
            raise ValueError("a quaternion is zero")
        x, y, z, w = np.array([x, y, z, w]) / length
        turn = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        return np.array(turn), place


def _shape(words: _Words, whole: Pose) -> Region:
    """One shape with its pose in its object."""
    kind = words.name()
    match kind:
        case "box":
            size = words.numbers(3)
            body: Convex | Numbers | float = Convex.box(size.tolist())
        case "sphere":
            body = float(words.numbers(1)[0])
        case "cylinder" | "cone":
            radius, length = words.numbers(2)
            body = Convex.cylinder(radius, length, 0.0 if kind == "cone" else 1.0)
        case "plane":
            body = words.numbers(4)
        case "mesh":
            corners, triangles = words.count(), words.count()
            body = Convex.around(words.numbers(3 * corners).reshape(-1, 3))
            words.numbers(3 * triangles)
        case _:
            raise ValueError(f"a shape is {kind!r}, expected box, sphere, cylinder, cone, plane or mesh")
    turn, place = words.pose()
    words.numbers(4)  # its colour
    turn, place = whole[0] @ turn, whole[1] + whole[0] @ place
    if isinstance(body, Convex):
        return body.placed(turn, place)
    if isinstance(body, float):
        return Sphere((float(place[0]), float(place[1]), float(place[2])), body)
    normal = turn @ body[:3]
    offset = float(normal @ place - body[3]) / max(float(np.linalg.norm(normal)), 1e-300)
    return Plane((float(normal[0]), float(normal[1]), float(normal[2])), offset)
