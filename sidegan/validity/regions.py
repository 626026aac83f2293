"""Keep-out regions of the workspace: half spaces and boxes, in world coordinates."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from sidegan.errors import ConfigError

_GOLDEN = (5**0.5 - 1) / 2
_SECTIONS = 40  # golden sections: leaves 0.618⁴⁰ = 4e-9 of a capsule's length


@dataclass(frozen=True)
class Plane:
    """Keep out of the half space n·x < offset [m] (n is normalised)."""

    normal: tuple[float, float, float]
    offset: float

    def __post_init__(self) -> None:
        length = float(np.linalg.norm(self.normal))
        if len(self.normal) != 3 or not np.isfinite([length, self.offset]).all() or length == 0:
            raise ConfigError(f"a plane needs a non-zero normal of three numbers and an offset, got {self}")
        object.__setattr__(self, "normal", tuple(float(x) / length for x in self.normal))

    def margin(self, a: Tensor, b: Tensor) -> Tensor:
        """Signed distance [m], (…), of segments with end points (3, …) to the region."""
        normal = a.new_tensor(self.normal)
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

    def margin(self, a: Tensor, b: Tensor) -> Tensor:
        """Signed distance [m], (…), of segments with end points (3, …) to the region.

        The signed distance to a convex body is convex along a segment: golden sections find its
        minimum, where by the envelope theorem the gradient is exact.
        """
        with torch.no_grad():
            low, high = torch.zeros_like(a[0]), torch.ones_like(a[0])
            for _ in range(_SECTIONS):
                left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
                nearer = self._distance(torch.lerp(a, b, left)) < self._distance(torch.lerp(a, b, right))
                low, high = torch.where(nearer, low, left), torch.where(nearer, right, high)
            s = (low + high) / 2
        ends = torch.minimum(self._distance(a), self._distance(b))
        return torch.minimum(ends, self._distance(torch.lerp(a, b, s)))

    def _distance(self, x: Tensor) -> Tensor:
        shape = (3,) + (1,) * (x.ndim - 1)
        lower, upper = x.new_tensor(self.lower).view(shape), x.new_tensor(self.upper).view(shape)
        beyond = (x - (lower + upper) / 2).abs() - (upper - lower) / 2
        outside = (beyond.clamp_min(0) ** 2).sum(0).clamp_min(1e-24).sqrt()
        return outside + beyond.amax(0).clamp_max(0)


Region = Plane | Box
