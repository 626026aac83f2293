"""Triangles of the solids that descriptions know, about their own origin."""

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

Surface = tuple[NDArray[np.float64], NDArray[np.int64]]  # vertices [m], (V, 3), and faces, triangles (F, 3)

_AROUND = 32  # corners of a circle
_CAP = 8  # rings from the pole of a half sphere to its rim


def box(size: Sequence[float]) -> Surface:
    """A box with these edges [m]."""
    corners = np.array([*product((-0.5, 0.5), repeat=3)]) * size
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return corners, triangles(quads)


def cylinder(radius: float, length: float) -> Surface:
    """A cylinder along z, [m]."""
    return _triangulated(np.array([0, radius, radius, 0]), np.array([-1, -1, 1, 1]) * length / 2)


def capsule(radius: float, length: float) -> Surface:
    """All points within a radius of a segment of some length along z, [m]; a ball where that is zero."""
    width, height = dome(radius, _CAP)
    ends = np.repeat([-0.5, 0.5], _CAP + 1) * length
    return _triangulated(width, height + ends)


def dome(radius: float, rings: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Profile of a ball: radii and heights [m] of the rings of its lower half, then of its upper one."""
    tilt = np.linspace(0, np.pi / 2, rings + 1)
    shape = np.concatenate([np.sin(tilt), np.cos(tilt)]), np.concatenate([-np.cos(tilt), np.sin(tilt)])
    return shape[0] * radius, shape[1] * radius


def turned(radius: NDArray[np.float64], height: NDArray[np.float64], around: int) -> Surface:
    """The surface of a profile (N,) that turns about z, from below, with faces of four corners (F, 4)."""
    turn = np.linspace(0, 2 * np.pi, around, endpoint=False)
    circle = np.stack([np.cos(turn), np.sin(turn), np.ones(around)], 1)
    rings = circle * np.stack([radius, radius, height], 1)[:, None]
    corner = np.arange(rings[..., 0].size).reshape(rings.shape[:2])
    after = np.roll(corner, -1, axis=1)
    faces = np.stack([corner[:-1], after[:-1], after[1:], corner[1:]], -1)
    return rings.reshape(-1, 3), faces.reshape(-1, 4)


def _triangulated(radius: NDArray[np.float64], height: NDArray[np.float64]) -> Surface:
    vertices, faces = turned(radius, height, _AROUND)
    return vertices, triangles(faces)


def triangles(quads: NDArray[np.int64]) -> NDArray[np.int64]:
    """Two triangles for each face of four corners, (2 F, 3)."""
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
