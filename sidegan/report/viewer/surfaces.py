"""Surfaces small enough for a page: few triangles, short numbers."""

from collections.abc import Sequence
from itertools import groupby, product
from typing import Any

import numpy as np
import scipy  # its parts are imported when they are used
from numpy.typing import NDArray

from sidegan.report.pose import capsule_mesh
from sidegan.robot import Arm
from sidegan.robot.looks import Colour, Part, visual_parts
from sidegan.validity import Convex, Plane, Region, Sphere

_TRIANGLES = 120_000  # of an arm; more are merged
_FINEST, _COARSER = 5e-4, 1.4  # [m] of cells in which vertices are merged, and the factor to the next ones
_SPHERE = 400  # corners of a ball
_THIN = 1e-6  # [m] below which a surface has no thickness
_DENSE = 2**31  # numbers of rows from which on they are counted anew
_STEPS = 65_535  # of a coordinate within its surface's box


def arm_parts(arm: Arm) -> tuple[list[Part], list[Part]]:
    """Surfaces of what an arm looks like, one per joint and colour, and of its capsules.

    Links without a shape of their own are shown as their capsules.
    """
    shapes = capsule_parts(arm)
    looks = visual_parts(arm)
    seen = {part.link for part in looks}
    return fewer(merged([*looks, *(part for part in shapes if part.link not in seen)])), merged(shapes)


def capsule_parts(arm: Arm) -> list[Part]:
    """The surfaces of an arm's capsules."""
    capsules, parts = arm.capsules, []
    for k, link in enumerate(capsules.link.tolist()):
        mesh = capsule_mesh(capsules.a[k].numpy(), capsules.b[k].numpy(), float(capsules.radius[k]))
        parts.append(Part(link, mesh.vertices, mesh.faces, None))
    return parts


def region_surface(region: Region) -> Part | None:
    """The surface of a keep-out region; None of a plane, which has no end."""
    if isinstance(region, Plane):
        return None
    if isinstance(region, Convex):
        return hull(region.points)
    if isinstance(region, Sphere):
        return hull(np.array(region.centre) + region.radius * _sphere())
    return hull(np.array(list(product(*zip(region.lower, region.upper)))))


def _sphere() -> NDArray[np.float64]:
    """Points on the unit sphere, (N, 3), along a spiral."""
    height = np.linspace(-1, 1, _SPHERE)
    turn = np.pi * (1 + 5**0.5) * np.arange(_SPHERE)
    width = np.sqrt(1 - height**2)
    return np.stack([width * np.cos(turn), width * np.sin(turn), height], 1)


def hull(points: NDArray[np.float64]) -> Part:
    """The convex hull of points [m], (N, 3), in the world."""
    triangles = scipy.spatial.ConvexHull(points)
    corners = points[triangles.simplices]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inwards = (normal * triangles.equations[:, :3]).sum(1) < 0
    faces = np.where(inwards[:, None], triangles.simplices[:, ::-1], triangles.simplices)
    return Part(-1, points, faces.astype(np.int64), None)


def merged(parts: Sequence[Part]) -> list[Part]:
    """One part for all of a joint and a colour."""

    def key(part: Part) -> tuple[int, Colour]:
        return part.link, part.colour or (-1.0, -1.0, -1.0)

    joined = []
    for _, group in groupby(sorted(parts, key=key), key):
        some = list(group)
        starts = np.cumsum([0, *(len(part.vertices) for part in some)])
        faces = np.concatenate([part.faces + start for part, start in zip(some, starts)])
        joined.append(Part(some[0].link, np.concatenate([x.vertices for x in some]), faces, some[0].colour))
    return joined


def fewer(parts: Sequence[Part]) -> list[Part]:
    """The same surfaces with vertices merged that coincide, and those near each other if there are too many.

    Vertices in one cell of a grid become their mean, triangles without extent are dropped.
    """
    made = [_clustered(part, _FINEST / 100) for part in parts]
    size = _FINEST
    while sum(len(part.faces) for part in made) > _TRIANGLES:
        made = [_clustered(part, size) for part in parts]
        size *= _COARSER
    return [part for part in made if len(part.faces)]


def _clustered(part: Part, size: float) -> Part:
    cells = np.floor(part.vertices / size).astype(np.int64)
    _, index, count = np.unique(_numbered(cells), return_inverse=True, return_counts=True)
    means = np.stack([np.bincount(index, part.vertices[:, k]) for k in range(3)], 1) / count[:, None]
    faces = index[part.faces]
    apart = (faces != np.roll(faces, 1, axis=1)).all(1)
    _, first = np.unique(_numbered(np.sort(faces[apart], axis=1)), return_index=True)
    return Part(part.link, means, faces[apart][np.sort(first)], part.colour)


def _numbered(rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """A number for each of some rows (N, 3), equal for equal ones and in their order: quick to sort."""
    number = np.zeros(len(rows), dtype=np.int64)
    for column in rows.T:
        low, high = column.min(initial=0), column.max(initial=0)
        number = number * (high - low + 1) + (column - low)
        if number.max(initial=0) >= _DENSE:  # the next product might not be a number any more
            number = np.unique(number, return_inverse=True)[1]
    return number


def packed(part: Part) -> tuple[dict[str, Any], NDArray[np.uint16], NDArray[np.int64]]:
    """A surface in short numbers: its box, vertices (V, 3) as steps within it, and faces (F, 3)."""
    low, high = part.vertices.min(0), part.vertices.max(0)
    step = np.maximum(high - low, _THIN) / _STEPS
    head = {"link": part.link, "colour": part.colour, "low": low.tolist(), "step": step.tolist()}
    return head, np.rint((part.vertices - low) / step).astype(np.uint16), part.faces
