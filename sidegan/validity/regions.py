"""Keep-out regions of the workspace, in world coordinates: half spaces, boxes, spheres and convex bodies."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy  # submodules load lazily

from sidegan.base.arrays import Array
from sidegan.errors import ConfigError
from sidegan.kernels.chain import BALL, BOX, CONVEX, PLANE
from sidegan.robot.fitting import hull_of, inflated

_UNIT = 1e-3  # tolerance of a unit normal's length
_AROUND = 32  # planes around a cylinder, which enlarge its radius by 0.5 %
_TURN = np.radians(30)  # largest angle between planes that touch the same edge
_SAME_PLANE = 9  # digits in which equal planes agree


@dataclass(frozen=True)
class Plane:
    """Keep out of the half space normal·x < offset [m]."""

    normal: tuple[float, float, float]  # of length 1
    offset: float

    def __post_init__(self) -> None:
        length = float(np.linalg.norm(self.normal))
        if len(self.normal) != 3 or not np.isfinite([length, self.offset]).all() or length == 0:
            raise ConfigError(f"a plane needs a non-zero normal of three numbers and an offset, got {self}")
        if abs(length - 1) > _UNIT and self.offset:
            unit = ", ".join(f"{x:.6g}" for x in self.unit)
            raise ConfigError(
                f"the normal of {self} is {length:.4g} long, so that its offset is ambiguous: expected "
                f"a unit normal, [{unit}], and the offset along it [m]"
            )

    @property
    def unit(self) -> list[float]:
        """The normal, rid of its rounding."""
        length = float(np.linalg.norm(self.normal))
        return [float(x) / length for x in self.normal]

    @property
    def numbers(self) -> list[float]:
        """Unit normal and offset for compiled kernels."""
        return [*self.unit, self.offset, 0.0, 0.0]

    def grown(self, by: float) -> "Plane":
        """The region with its surface moved outwards by a distance [m]."""
        x, y, z = self.unit
        return Plane((x, y, z), self.offset + by)


@dataclass(frozen=True)
class Box:
    """Keep out of an axis-aligned box, corners ``lower`` and ``upper`` [m]."""

    lower: tuple[float, float, float]
    upper: tuple[float, float, float]

    def __post_init__(self) -> None:
        finite = len(self.lower) == len(self.upper) == 3 and np.isfinite([*self.lower, *self.upper]).all()
        if not finite or any(low >= high for low, high in zip(self.lower, self.upper)):
            raise ConfigError(f"a box needs three coordinates in lower, all below those in upper, got {self}")

    @property
    def numbers(self) -> list[float]:
        """Centre and half size for compiled kernels."""
        sides = list(zip(self.lower, self.upper))
        return [(low + high) / 2 for low, high in sides] + [(high - low) / 2 for low, high in sides]

    @property
    def planes(self) -> Array:
        """Unit normals and offsets [m] of its faces, (6, 4)."""
        return np.c_[np.vstack([np.eye(3), -np.eye(3)]), [*self.upper, *(-x for x in self.lower)]]

    def grown(self, by: float) -> "Box":
        """The box with its faces moved outwards by a distance [m]."""
        (a, b, c), (d, e, f) = self.lower, self.upper
        return Box((a - by, b - by, c - by), (d + by, e + by, f + by))


@dataclass(frozen=True)
class Sphere:
    """Keep out of a sphere [m]."""

    centre: tuple[float, float, float]
    radius: float

    def __post_init__(self) -> None:
        numbers = np.array([*self.centre, self.radius], float)
        if len(numbers) != 4 or not np.isfinite(numbers).all() or self.radius <= 0:
            raise ConfigError(f"a sphere needs a centre of three numbers and a radius above 0, got {self}")

    @property
    def numbers(self) -> list[float]:
        """Centre and radius for compiled kernels."""
        return [*self.centre, self.radius, 0.0, 0.0]

    def grown(self, by: float) -> "Sphere":
        """The sphere with its radius enlarged by a distance [m]."""
        return Sphere(self.centre, self.radius + by)


@dataclass(frozen=True, eq=False)
class Convex:
    """Keep out of a convex body, given by supporting planes.

    The distance is that to the farthest plane: never more than the distance to the body, and exact inside
    and in front of faces. Further planes at edges, at most 30° apart, and at corners limit the error in
    front of these to a few per cent.
    """

    planes: Array  # outward unit normals, and offsets n·x [m], (K, 4)
    points: Array  # corners [m], (V, 3)

    @classmethod
    def around(cls, points: Array) -> "Convex":
        """The convex hull of points [m], (N, 3); ConfigError if it has no volume."""
        points = np.asarray(points, float)
        hull = hull_of(points) if points.shape[1:] == (3,) else None
        if hull is None:
            raise ConfigError("an obstacle needs corners (N, 3) that are finite and enclose a volume")
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
        """The body with its planes moved outwards by a distance [m]; its corners are replaced by cubes'."""
        return Convex(self.planes + np.array([0.0, 0.0, 0.0, by]), inflated(self.points, by))

    @property
    def numbers(self) -> list[float]:
        """Centre and radius [m] of an enclosing sphere, for compiled kernels."""
        centre = (self.points.min(0) + self.points.max(0)) / 2
        return [*centre.tolist(), float(np.linalg.norm(self.points - centre, axis=1).max()), 0.0, 0.0]


Obstacle = Plane | Box | Sphere | Convex


def distance(region: Obstacle, point: Array) -> float:
    """Least distance [m] of a point (3,) from a region, negative inside; of convex bodies, a lower bound."""
    if isinstance(region, Plane):
        return float(point @ region.unit) - region.offset
    if isinstance(region, Sphere):
        return float(np.linalg.norm(point - region.centre)) - region.radius
    return float((region.planes[:, :3] @ point - region.planes[:, 3]).max())


_KINDS: dict[type[Obstacle], int] = {Plane: PLANE, Box: BOX, Sphere: BALL, Convex: CONVEX}


def tables(regions: Sequence[Obstacle]) -> tuple[Array, Array, Array]:
    """Regions for compiled kernels: numbers (R, 8), kinds (R,), and planes (M, 4) of boxes and convex bodies.

    The last two numbers of a box or a convex body are the range of its planes.
    """
    numbers = np.zeros((len(regions), 8))
    planes = [np.zeros((0, 4))]
    for row, region in zip(numbers, regions):
        row[:6] = region.numbers
        if isinstance(region, Box | Convex):
            start = sum(map(len, planes))
            planes.append(region.planes)
            row[6:] = start, start + len(region.planes)
    kinds = np.array([_KINDS[type(region)] for region in regions], int)
    return numbers, kinds, np.concatenate(planes)


def _touching(hull: "scipy.spatial.ConvexHull") -> Array:
    """Unit normals, (K, 3), of supporting planes at a hull's faces, edges and corners."""
    faces = hull.equations[:, :3]
    i = np.repeat(np.arange(len(faces)), 3)
    j = hull.neighbors.reshape(-1)
    i, j = i[i < j], j[i < j]
    angles = np.arccos(np.clip((faces[i] * faces[j]).sum(1), -1, 1))
    parts = [faces]
    for a, b, angle in zip(faces[i], faces[j], angles):
        share = np.arange(1, np.ceil(angle / _TURN))[:, None] / np.ceil(angle / _TURN)
        parts.append((np.sin((1 - share) * angle) * a + np.sin(share * angle) * b) / np.sin(angle))
    for corner in hull.vertices:
        around = faces[(hull.simplices == corner).any(1)]
        mean = np.unique(around.round(_SAME_PLANE), axis=0).sum(0)
        if (around @ mean).min() < np.cos(_TURN / 2) * np.linalg.norm(mean):
            parts.append(mean[None])
    normals = np.vstack([part for part in parts if len(part)])
    normals = np.unique(normals.round(_SAME_PLANE), axis=0)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _directions() -> Array:
    """Evenly spread unit vectors, (42, 3): corners and edge centres of an icosahedron."""
    golden = (1 + 5**0.5) / 2
    flat = [(0.0, s, t * golden) for s in (-1, 1) for t in (-1, 1)]
    corners = np.array([[p[-k], p[1 - k], p[2 - k]] for p in flat for k in range(3)])
    apart = np.linalg.norm(corners[:, None] - corners[None], axis=2)
    i, j = np.nonzero(np.triu(np.abs(apart - 2) < 1e-9))
    found = np.vstack([corners, (corners[i] + corners[j]) / 2])
    return found / np.linalg.norm(found, axis=1, keepdims=True)
