"""Keep-out regions of the workspace, in world coordinates: half spaces, boxes, and tables of all kinds."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sidegan.base.arrays import Array
from sidegan.errors import ConfigError
from sidegan.kernels.chain import BALL, BOX, CONVEX, PLANE
from sidegan.validity.obstacles import Convex, Sphere

_UNIT = 1e-3  # tolerance of a unit normal's length


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
        return replace(self, offset=self.offset + by)


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


Region = Plane | Box | Sphere | Convex


def distance(region: Region, point: Array) -> float:
    """Least distance [m] of a point (3,) from a region, negative inside; of convex bodies, a lower bound."""
    if isinstance(region, Plane):
        return float(point @ region.unit) - region.offset
    if isinstance(region, Sphere):
        return float(np.linalg.norm(point - region.centre)) - region.radius
    return float((region.planes[:, :3] @ point - region.planes[:, 3]).max())


_KINDS: dict[type[Region], int] = {Plane: PLANE, Box: BOX, Sphere: BALL, Convex: CONVEX}


def tables(regions: Sequence[Region]) -> tuple[Array, Array, Array]:
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
