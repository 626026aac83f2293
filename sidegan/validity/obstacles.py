"""Convex obstacles as keep-out regions: balls, cylinders, boxes at an angle, hulls of meshes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # its parts are imported when they are used

from sidegan.base.arrays import Array
from sidegan.errors import ConfigError

_AROUND = 32  # planes around a cylinder: it grows by 0.5 % of its radius
_TURN = np.radians(30)  # between planes that touch one edge
_SAME_PLANE = 9  # digits by which planes are one


@dataclass(frozen=True)
class Sphere:
    """Keep out of a ball [m]."""

    centre: tuple[float, float, float]
    radius: float

    def __post_init__(self) -> None:
        numbers = np.array([*self.centre, self.radius], float)
        if len(numbers) != 4 or not np.isfinite(numbers).all() or self.radius <= 0:
            raise ConfigError(f"a sphere needs a centre of three numbers and a radius above 0, got {self}")

    @property
    def numbers(self) -> list[float]:
        """Centre and radius, as compiled kernels take them."""
        return [*self.centre, self.radius, 0.0, 0.0]

    def grown(self, by: float) -> "Sphere":
        """The ball with a radius so much [m] larger."""
        return Sphere(self.centre, self.radius + by)


@dataclass(frozen=True, eq=False)
class Convex:
    """Keep out of a convex body, given by planes that touch it from outside.

    The distance that counts is that to the farthest of the planes: never more than the distance to the body,
    and exact inside and in front of faces. Beside the faces' own, planes at angles of at most 30° touch the
    edges, and others the corners, so that in front of those it is short by a few per cent.
    """

    planes: Array  # unit normals, outwards, and offsets n·x [m], (K, 4)
    points: Array  # corners [m], (V, 3)

    @classmethod
    def around(cls, points: Array) -> "Convex":
        """The convex hull of points [m], (N, 3); a ConfigError where they have no volume."""
        points = np.asarray(points, float)
        try:
            hull = scipy.spatial.ConvexHull(points)
        except (scipy.spatial.QhullError, ValueError) as error:
            raise ConfigError("an obstacle needs corners that are finite and enclose a volume") from error
        corners = points[hull.vertices]
        normals = np.vstack([_touching(hull), _directions()])
        return cls(np.c_[normals, (corners @ normals.T).max(0)], corners)

    @classmethod
    def between(cls, lower: Sequence[float], upper: Sequence[float], radius: float) -> "Convex":
        """A cylinder [m] around the segment between two points."""
        a, b = np.array(lower, float), np.array(upper, float)
        length = float(np.linalg.norm(b - a)) if len(a) == len(b) == 3 else 0.0
        if not np.isfinite([length, radius]).all() or min(length, radius) <= 0:
            raise ConfigError(
                f"a cylinder needs two different points and a radius above 0, got {lower}, {upper}, {radius}"
            )
        z = (b - a) / length
        x = np.cross(z, np.eye(3)[np.abs(z).argmin()])
        x /= np.linalg.norm(x)
        turn = np.linspace(0, 2 * np.pi, _AROUND, endpoint=False)[:, None]
        ring = radius / np.cos(np.pi / _AROUND) * (np.cos(turn) * x + np.sin(turn) * np.cross(z, x))
        return cls.around(np.vstack([ring + a, ring + b]))

    def grown(self, by: float) -> "Convex":
        """The body with its planes so much [m] further out, and corners of cubes around its own."""
        corners = np.array(np.meshgrid([-by, by], [-by, by], [-by, by])).reshape(3, 8).T
        points = (self.points[:, None] + corners).reshape(-1, 3)
        return Convex(self.planes + np.array([0.0, 0.0, 0.0, by]), points)

    @property
    def numbers(self) -> list[float]:
        """Centre and radius [m] of a ball around it, as compiled kernels take them."""
        centre = (self.points.min(0) + self.points.max(0)) / 2
        return [*centre.tolist(), float(np.linalg.norm(self.points - centre, axis=1).max()), 0.0, 0.0]


def _touching(hull: "scipy.spatial.ConvexHull") -> Array:
    """Unit normals, (K, 3), of planes on a hull's faces, around its edges and on its corners."""
    own = hull.equations[:, :3]
    i, j = np.repeat(np.arange(len(own)), 3), hull.neighbors.reshape(-1)
    i, j = i[i < j], j[i < j]
    angles = np.arccos(np.clip((own[i] * own[j]).sum(1), -1, 1))
    parts = [own]
    for one, two, angle in zip(own[i], own[j], angles):
        share = np.arange(1, np.ceil(angle / _TURN))[:, None] / np.ceil(angle / _TURN)
        parts.append((np.sin((1 - share) * angle) * one + np.sin(share * angle) * two) / np.sin(angle))
    for corner in hull.vertices:
        around = own[(hull.simplices == corner).any(1)]
        mean = np.unique(around.round(_SAME_PLANE), axis=0).sum(0)
        if (around @ mean).min() < np.cos(_TURN / 2) * np.linalg.norm(mean):
            parts.append(mean[None])
    normals = np.vstack([part for part in parts if len(part)])
    normals = np.unique(normals.round(_SAME_PLANE), axis=0)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _directions() -> Array:
    """Unit vectors, (42, 3), spread evenly: corners and middles of the edges of an icosahedron."""
    golden = (1 + 5**0.5) / 2
    flat = [(0.0, s, t * golden) for s in (-1, 1) for t in (-1, 1)]
    corners = np.array([[p[-k], p[1 - k], p[2 - k]] for p in flat for k in range(3)])
    apart = np.linalg.norm(corners[:, None] - corners[None], axis=2)
    i, j = np.nonzero(np.triu(np.abs(apart - 2) < 1e-9))
    found = np.vstack([corners, (corners[i] + corners[j]) / 2])
    return found / np.linalg.norm(found, axis=1, keepdims=True)
