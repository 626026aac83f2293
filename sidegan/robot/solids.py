"""Surfaces of primitive solids: vertices [m], (V, 3), and triangles (F, 3), counterclockwise from outside."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Surface = tuple[NDArray[np.float64], NDArray[np.int64]]

_AROUND, _RINGS = 32, 12  # points of a ring, and rings of a hemisphere
_QUADS = np.array(
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
)  # of a box's corners, z fastest


def box(lower: ArrayLike, upper: ArrayLike) -> Surface:
    """A box between two corners."""
    corners = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), -1).reshape(-1, 3)
    vertices = np.where(corners, upper, lower).astype(float)
    return vertices, np.concatenate([_QUADS[:, [0, 1, 2]], _QUADS[:, [0, 2, 3]]])


def cylinder(radius: float, length: float) -> Surface:
    """A cylinder along z, centred."""
    return _revolved([radius, radius], [-length / 2, length / 2], length / 2)


def capsule(radius: float, length: float, rings: int = _RINGS, around: int = _AROUND) -> Surface:
    """A cylinder along z with hemispheres at its ends, centred; a sphere if it has no length."""
    angle = np.linspace(0, np.pi / 2, rings, endpoint=False)
    radii = radius * np.cos(angle)
    heights = length / 2 + radius * np.sin(angle)
    start = 0 if length else 1  # the equator of a sphere once
    return _revolved(
        [*radii[::-1], *radii[start:]], [*-heights[::-1], *heights[start:]], length / 2 + radius, around
    )


def _revolved(radii: ArrayLike, heights: ArrayLike, end: float, around: int = _AROUND) -> Surface:
    """The surface through rings around z, upwards, and through -end and end on z."""
    angle = np.linspace(0, 2 * np.pi, around, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle), np.ones(around)], 1)
    rings = np.stack([radii, radii, heights], 1)[:, None] * ring
    vertices = np.concatenate([[[0, 0, -end]], rings.reshape(-1, 3), [[0, 0, end]]])
    numbers = 1 + np.arange(rings[..., 0].size).reshape(-1, around)
    rows = np.pad(numbers, ((1, 1), (0, 0)), constant_values=((0, len(vertices) - 1), (0, 0)))
    turned = np.roll(rows, -1, 1)
    lower = np.stack([rows[1:-1], turned[1:-1], rows[2:]], -1)
    upper = np.stack([turned[:-2], turned[1:-1], rows[1:-1]], -1)
    return vertices, np.concatenate([lower, upper]).reshape(-1, 3)
