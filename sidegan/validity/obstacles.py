"""Convex obstacles as keep-out regions: balls, cylinders, boxes at an angle, hulls of meshes."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # its parts are imported when they are used
import torch
from numpy.typing import NDArray
from torch import Tensor

from sidegan.errors import ConfigError

Points = NDArray[np.float64]

_TOUCHING = 1e-12  # [m] the least distance of a point, as compiled kernels have it
_AROUND = 32  # planes around a cylinder or a cone: it grows by 0.5 % of its radius
_TURN = np.radians(30)  # between planes that touch one edge
_SAME_PLANE = 9  # digits by which planes are one
_AT_ONCE = 20_000  # segments: bounds the memory to some tens of megabytes
_STEPS = 60  # of the search along a segment, which takes five
_SETTLED = 1e-12  # [m] between a bound from below and what is found


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

    def margin(self, a: Tensor, b: Tensor) -> Tensor:
        """Signed distance [m], (…), of segments with end points (3, …) to the region."""
        centre = a.new_tensor(self.centre).view(3, *(1 for _ in a.shape[1:]))
        along, start = b - a, centre - a
        length = (along * along).sum(0).clamp_min(torch.finfo(a.dtype).tiny)
        share = ((start * along).sum(0) / length).clamp(0, 1)
        return (a + share * along - centre).norm(dim=0).clamp_min(_TOUCHING) - self.radius


@dataclass(frozen=True, eq=False)
class Convex:
    """Keep out of a convex body, given by planes that touch it from outside.

    The distance that counts is that to the farthest of the planes: never more than the distance to the body,
    and exact inside and in front of faces. Beside the faces' own, planes at angles of at most 30° touch the
    edges, and others the corners, so that in front of those it is short by a few per cent.
    """

    normals: Points  # unit, outwards, (K, 3)
    offsets: Points  # n·x of the planes [m], (K,)
    points: Points  # corners [m], (V, 3)

    @classmethod
    def around(cls, points: Points) -> "Convex":
        """The convex hull of points [m], (N, 3).

        Raises:
            ConfigError: when they have no volume.
        """
        points = np.asarray(points, float)
        try:
            hull = scipy.spatial.ConvexHull(points)
        except (scipy.spatial.QhullError, ValueError) as error:
            raise ConfigError("an obstacle needs corners that are finite and enclose a volume") from error
        corners = points[hull.vertices]
        normals = np.vstack([_touching(hull), directions()])
        return cls(normals, (corners @ normals.T).max(0), corners)

    @classmethod
    def box(cls, size: Sequence[float]) -> "Convex":
        """A box of three edges [m] around the origin."""
        corners = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T
        return cls.around(corners * np.array(size) / 2)

    @classmethod
    def cylinder(cls, radius: float, length: float, tip: float = 1.0) -> "Convex":
        """A cylinder [m] around the origin along z; a cone that ends in its ``tip`` share of the radius."""
        turn = np.linspace(0, 2 * np.pi, _AROUND, endpoint=False)
        ring = radius / np.cos(np.pi / _AROUND) * np.stack([np.cos(turn), np.sin(turn)], 1)
        ends = [(ring, -length / 2), (max(tip, 1e-9) * ring, length / 2)]
        return cls.around(np.vstack([np.c_[flat, np.full(_AROUND, z)] for flat, z in ends]))

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
        return cls.cylinder(radius, length).placed(np.stack([x, np.cross(z, x), z], 1), (a + b) / 2)

    def placed(self, turn: Points, place: Points) -> "Convex":
        """Body turned by (3, 3) and then moved by (3,) [m]."""
        return Convex.around(self.points @ np.asarray(turn, float).T + np.asarray(place, float))

    def grown(self, by: float) -> "Convex":
        """The body with its planes so much [m] further out, and corners of cubes around its own."""
        corners = np.array(np.meshgrid([-by, by], [-by, by], [-by, by])).reshape(3, 8).T
        points = (self.points[:, None] + corners).reshape(-1, 3)
        return Convex(self.normals, self.offsets + by, points)

    @property
    def volume(self) -> float:
        """Its volume [m³]."""
        return float(scipy.spatial.ConvexHull(self.points).volume)

    @cached_property
    def ball(self) -> list[float]:
        """Centre and radius [m] of a ball around the body."""
        centre = (self.points.min(0) + self.points.max(0)) / 2
        return [*centre.tolist(), float(np.linalg.norm(self.points - centre, axis=1).max())]

    @property
    def numbers(self) -> list[float]:
        """The ball around it, as compiled kernels take it."""
        return [*self.ball, 0.0, 0.0]

    @property
    def planes(self) -> Points:
        """Unit normals and offsets [m] of its planes, (K, 4)."""
        return np.c_[self.normals, self.offsets]

    def margin(self, a: Tensor, b: Tensor) -> Tensor:
        """Signed distance [m], (…), of segments with end points (3, …) to the region, or a little less."""
        parts = zip(a.reshape(3, -1).split(_AT_ONCE, 1), b.reshape(3, -1).split(_AT_ONCE, 1))
        return torch.cat([self._margin(*part) for part in parts]).reshape(a.shape[1:])

    def _margin(self, a: Tensor, b: Tensor) -> Tensor:
        """The least along the segments of the largest of linear functions."""
        normals, offsets = a.new_tensor(self.normals), a.new_tensor(self.offsets)
        return _lowest(normals @ a - offsets[:, None], normals @ (b - a))


def _lowest(start: Tensor, slope: Tensor) -> Tensor:
    """The smallest value over shares 0 … 1, (S,), of the largest of linear functions (K, S).

    It is where two of them cross, one that falls and one that rises, each the largest on its side.
    """
    one, two = start.argmax(0), (start + slope).argmax(0)
    columns, value = torch.arange(start.shape[1], device=start.device), start.amax(0)
    for _ in range(_STEPS):
        (a, da), (b, db) = ((start[k, columns], slope[k, columns]) for k in (one, two))
        steep = (db - da).clamp_min(torch.finfo(start.dtype).tiny)
        share = torch.where(da >= 0, 0.0, torch.where(db <= 0, 1.0, ((a - b) / steep).clamp(0, 1)))
        value, top = (start + share * slope).max(0)
        settled = (da >= 0) | (db <= 0) | (value <= a + da * share + _SETTLED)
        if settled.all():
            break
        rises = slope[top, columns] > 0
        one = torch.where(~settled & ~rises, top, one)
        two = torch.where(~settled & rises, top, two)
    return value


def _touching(hull: "scipy.spatial.ConvexHull") -> Points:
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


def directions() -> Points:
    """Unit vectors, (42, 3), spread evenly: corners and middles of the edges of an icosahedron."""
    golden = (1 + 5**0.5) / 2
    flat = [(0.0, s, t * golden) for s in (-1, 1) for t in (-1, 1)]
    corners = np.array([[p[-k], p[1 - k], p[2 - k]] for p in flat for k in range(3)])
    apart = np.linalg.norm(corners[:, None] - corners[None], axis=2)
    i, j = np.nonzero(np.triu(np.abs(apart - 2) < 1e-9))
    found = np.vstack([corners, (corners[i] + corners[j]) / 2])
    return found / np.linalg.norm(found, axis=1, keepdims=True)
