"""Keep-out regions of the workspace, in world coordinates: half spaces and boxes, and all that there are."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from sidegan.errors import ConfigError
from sidegan.kernels.chain import BALL, BOX, CONVEX, PLANE
from sidegan.validity.obstacles import Convex, Sphere

_HALVINGS = 36  # of a capsule's axis: leaves 1e-11 of its length


@dataclass(frozen=True)
class Plane:
    """Keep out of the half space n·x < offset [m], for the unit vector n along the normal."""

    normal: tuple[float, float, float]  # of any length
    offset: float

    def __post_init__(self) -> None:
        length = float(np.linalg.norm(self.normal))
        if len(self.normal) != 3 or not np.isfinite([length, self.offset]).all() or length == 0:
            raise ConfigError(f"a plane needs a non-zero normal of three numbers and an offset, got {self}")

    @property
    def unit(self) -> list[float]:
        """The normal, of length one."""
        length = float(np.linalg.norm(self.normal))
        return [float(x) / length for x in self.normal]

    @property
    def numbers(self) -> list[float]:
        """Unit normal and offset, as compiled kernels take them."""
        return [*self.unit, self.offset, 0.0, 0.0]

    def grown(self, by: float) -> "Plane":
        """The region with its surface so much [m] further out."""
        return replace(self, offset=self.offset + by)

    def margin(self, a: Tensor, b: Tensor) -> Tensor:
        """Signed distance [m], (…), of segments with end points (3, …) to the region."""
        normal = a.new_tensor(self.unit)
        height = torch.minimum(torch.tensordot(normal, a, 1), torch.tensordot(normal, b, 1))
        return height - self.offset


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
        """Centre and half size, as compiled kernels take them."""
        sides = list(zip(self.lower, self.upper))
        return [(low + high) / 2 for low, high in sides] + [(high - low) / 2 for low, high in sides]

    @property
    def planes(self) -> np.ndarray:
        """Unit normals and offsets [m] of its faces, (6, 4)."""
        return np.c_[np.vstack([np.eye(3), -np.eye(3)]), [*self.upper, *(-x for x in self.lower)]]

    def grown(self, by: float) -> "Box":
        """The box with its faces so much [m] further out."""
        (a, b, c), (d, e, f) = self.lower, self.upper
        return Box((a - by, b - by, c - by), (d + by, e + by, f + by))

    def margin(self, a: Tensor, b: Tensor) -> Tensor:
        """Signed distance [m], (…), of segments with end points (3, …) to the region.

        The signed distance to a convex body is convex along a segment: halving by the sign of its slope finds
        the minimum.
        """
        shape = (3,) + (1,) * (a.ndim - 1)
        lower, upper = a.new_tensor(self.lower).view(shape), a.new_tensor(self.upper).view(shape)
        half, along = (upper - lower) / 2, b - a
        a = a - lower - half
        low, high = torch.zeros_like(a[0]), torch.ones_like(a[0])
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            falls = (_outwards(a + middle * along, half) * along).sum(0) < 0
            low, high = torch.where(falls, middle, low), torch.where(falls, high, middle)
        return torch.minimum(_distance(a + low * along, half), _distance(a + high * along, half))


def _distance(x: Tensor, half: Tensor) -> Tensor:
    """Signed distance [m], (…), of points (3, …) from a box at the origin."""
    beyond = x.abs() - half
    outside = beyond.clamp_min(0).norm(dim=0)
    return outside + beyond.amax(0).clamp_max(0)


def _outwards(x: Tensor, half: Tensor) -> Tensor:
    """Direction, (3, …), in which the distance from the box grows fastest; of any length."""
    beyond = x.abs() - half
    farthest = beyond.amax(0)
    return torch.where(farthest > 0, beyond.clamp_min(0), (beyond == farthest).to(x)).copysign(x)


Region = Plane | Box | Sphere | Convex
_KINDS: dict[type[Region], int] = {Plane: PLANE, Box: BOX, Sphere: BALL, Convex: CONVEX}


def tables(regions: Sequence[Region]) -> tuple[Tensor, Tensor, Tensor]:
    """Regions as compiled kernels take them: numbers (R, 8), kinds (R,), and planes (M, 4) of bodies.

    The last two numbers of a box or a convex body say where its planes begin and end.
    """
    numbers = torch.zeros(len(regions), 8, dtype=torch.float64)
    planes = [torch.zeros(0, 4, dtype=torch.float64)]
    for row, region in zip(numbers, regions):
        row[:6] = torch.tensor(region.numbers, dtype=torch.float64)
        if isinstance(region, Box | Convex):
            start = sum(map(len, planes))
            planes.append(torch.from_numpy(region.planes))
            row[6:] = torch.tensor([start, start + len(region.planes)])
    kinds = torch.tensor([_KINDS[type(region)] for region in regions], dtype=torch.long)
    return numbers, kinds, torch.cat(planes)
