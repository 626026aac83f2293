"""Surfaces reduced to a size that fits a page."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sidegan.robot import Arm
from sidegan.robot.visuals import Part, capsule_surface, visual_parts
from sidegan.validity import Box, Convex, Sphere

_TRIANGLES = 120_000  # most triangles of an arm
_FINEST, _COARSER = 5e-4, 1.4  # smallest grid cell for merging vertices [m], and factor to the next size
_CELLS = 2**20  # most grid cells along an axis


def arm_parts(arm: Arm) -> tuple[list[Part], list[Part]]:
    """Visual surfaces of an arm, and those of its capsules; links without a visual show their capsules."""
    capsules = arm.capsules
    looks = visual_parts(arm)
    each = zip(capsules.link.tolist(), capsules.a, capsules.b, capsules.radius.tolist())
    shapes = [Part(link, *capsule_surface(a, b, radius)) for link, a, b, radius in each]
    seen = {part.link for part in looks}
    return fewer([*looks, *(part for part in shapes if part.link not in seen)]), shapes


def region_surface(region: Box | Sphere | Convex) -> Part:
    """The surface of a bounded keep-out region."""
    import trimesh  # slow to import

    if isinstance(region, Sphere):
        mesh = trimesh.creation.icosphere(3, region.radius).apply_translation(region.centre)
    elif isinstance(region, Convex):
        mesh = trimesh.convex.convex_hull(region.points)
    else:
        mesh = trimesh.creation.box(bounds=[region.lower, region.upper])
    return Part(-1, np.asarray(mesh.vertices), np.asarray(mesh.faces))


def fewer(parts: Sequence[Part]) -> list[Part]:
    """Surfaces with coincident vertices merged, and nearby ones too if there are too many triangles.

    Vertices in a grid cell are replaced by their mean; degenerate triangles are dropped.
    """
    made = [_clustered(part, _FINEST / 100) for part in parts]
    size = _FINEST
    while sum(len(part.faces) for part in made) > _TRIANGLES:
        made = [_clustered(part, size) for part in parts]
        size *= _COARSER
    return [part for part in made if len(part.faces)]


def _clustered(part: Part, size: float) -> Part:
    size = max(size, np.ptp(part.vertices) / _CELLS)
    _, index = _distinct(np.floor(part.vertices / size).astype(np.int64))
    count = np.bincount(index)
    means = np.stack([np.bincount(index, column) for column in part.vertices.T], 1) / count[:, None]
    faces = index[part.faces]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(1)]
    return Part(part.link, means, faces[_distinct(np.sort(faces, axis=1))[0]])


def _distinct(rows: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First of the equal rows, and for each row the number of its value."""
    if not len(rows):
        return np.arange(0), np.arange(0)
    numbers = np.ravel_multi_index((rows - rows.min(0)).T, np.ptp(rows, 0) + 1)
    _, first, index = np.unique(numbers, return_index=True, return_inverse=True)
    return first, index
