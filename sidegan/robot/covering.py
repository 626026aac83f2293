"""Meshes of a link, cut by planes into parts with little empty space, each within a capsule and a hull.

Results are cached on disk under the digest of the meshes.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from sidegan.robot.fitting import (
    Capsule,
    Points,
    axes,
    corners,
    extreme_points,
    fit_capsule,
    guess,
    hull_of,
    hull_volume,
    nearly_fit,
    simplify_hull,
    split_triangles,
    volume,
)
from sidegan.robot.meshes import cache_folder

_PIECES = 4  # most parts of a mesh
_SAMPLE = 600  # triangles with which cuts are evaluated
_CUTS = np.linspace(0.14, 0.86, 7)  # where an axis is cut, as a share of the extent along it
_WORTH = 0.01  # least share of the total volume that each additional part must save
_CAPSULES = 0.3  # weight of capsule volumes relative to hull volumes
_HOLLOW, _LITTLE = 16, 0.0025  # most parts and least saving of hollow meshes at level 1
_MANY, _LEAST, _LEAST_EMPTY = 48, 0.0005, 0.0002  # the same at levels 2 and 3, with a saving for each
_FINE = 3e-4  # [m] by which hulls are enlarged at most to save corners
_FINER = 3e-5  # the same for hollow meshes: some links pass within a fraction of a millimetre
_ALONG = 1e-9  # cosine below which a ray runs along a facet

CutPlane = tuple[Points, float]  # a normal, (3,), and the height of the plane along it
Measure = Callable[[Points], float]  # what cuts are to save [m³], of triangles (N, 3, 3)


class ConvexPart(NamedTuple):
    """Body that contains some of a link's triangles, in the frame of the first mesh."""

    capsule: Capsule
    corners: Points  # of a convex hull [m], (V, 3)
    rounding: float  # radius [m] by which the hull is inflated


class _Cut(NamedTuple):
    """The best cut of a part: volume [m³] saved per additional part, and the planes."""

    saved: float
    planes: tuple[CutPlane, ...]


def cover_of(digest: str, hollow: int, meshes: Callable[[], list[Points]]) -> list[ConvexPart]:
    """Parts of the meshes with this digest, from the cache or else from ``meshes``."""
    from joblib import Memory

    return Memory(cache_folder(), verbose=0).cache(_made, ignore=["meshes"])(digest, hollow, meshes)


def _made(digest: str, hollow: int, meshes: Callable[[], list[Points]]) -> list[ConvexPart]:
    return cover(meshes(), _PIECES, hollow)


def cover(meshes: Sequence[Points], most: int, hollow: int = 0) -> list[ConvexPart]:
    """Parts of a link's meshes, with capsules and hulls that together contain all triangles.

    Up to ``most`` meshes are separate parts, since they are usually divided sensibly.

    Args:
        meshes: corners of the triangles of each mesh [m], (N, 3, 3).
        most: most parts of a single mesh, or of all if there are more than this many; otherwise each further
            mesh adds one.
        hollow: level at which hollow meshes are cut further: 1, where that reduces the volume of hulls; 2,
            into more parts; 3, into as many, where that reduces the empty space in front of the surface.
    """
    groups = [*meshes] if len(meshes) <= most else [np.concatenate(meshes)]
    if hollow < 2:
        parts = cut(groups, len(groups) + most - 1, _WORTH, partial(_volume, capsules=_CAPSULES))
    if hollow == 1:
        parts = cut(parts, max(_HOLLOW, len(parts)), _LITTLE, _volume)
    elif hollow:
        size, worth = (_volume, _LEAST) if hollow == 2 else (_empty, _LEAST_EMPTY)
        parts = cut(groups, _MANY, worth, size)
    outer = [corners(part.reshape(-1, 3)) for part in parts]
    capsule = nearly_fit if hollow > 1 else fit_capsule  # many parts are small: a guess will do
    return [
        ConvexPart(capsule(points), *simplify_hull(points, _FINER if hollow else _FINE)) for points in outer
    ]


def cut(parts: Sequence[Points], most: int, worth: float, size: Measure) -> list[Points]:
    """Parts, triangles (N, 3, 3) each, cut by planes into at most ``most`` with little empty space.

    Triangles are divided where a plane crosses them, so that no part reaches beyond its planes. Each
    additional part must save the share ``worth`` of the total size [m³].
    """
    found = [part for part in parts if len(part)]
    cuts = [_best(part, size) for part in found]
    enough = worth * sum(size(part) for part in found)
    while True:
        fitting = [k for k, cut in enumerate(cuts) if len(found) + 2 ** len(cut.planes) - 1 <= most]
        k = max(fitting, key=lambda i: cuts[i].saved, default=-1)
        if k < 0 or not cuts[k].saved > enough:
            return found
        sides = _sides(found[k], cuts[k].planes)
        found[k : k + 1], cuts[k : k + 1] = sides, [_best(side, size) for side in sides]


def _best(part: Points, size: Measure) -> _Cut:
    """The best cut of a part: in halves, or in quarters, which open a ring where halves do not."""
    points = part.reshape(-1, 3)
    chosen = np.linspace(0, len(part) - 1, min(len(part), _SAMPLE)).astype(int)
    outermost = np.unique(np.argmax(points @ axes(extreme_points(points)).T, axis=0) // 3)
    sample = part[np.union1d(chosen, outermost)]
    outer = extreme_points(sample.reshape(-1, 3))
    whole = size(sample)
    if not hull_volume(outer):  # flat: there is nothing to leave out
        return _Cut(0.0, ())
    ways = axes(outer)
    low = (outer @ ways.T).min(0)
    extent = np.ptp(outer @ ways.T, axis=0)
    planes = [((axis, float(h)),) for axis, a, s in zip(ways, low, extent) for h in a + s * _CUTS]
    middles = [(axis, float(a + s / 2)) for axis, a, s in zip(ways, low, extent)]
    quarters = [(middles[i], middles[k]) for i, k in ((0, 1), (0, 2), (1, 2), (3, 4), (3, 5), (4, 5))]
    share = len(part) / len(sample) if size is _empty else 1.0  # which grows with the number of triangles
    found = []
    for cut in (*planes, *quarters):
        sides = _sides(sample, cut)
        saved = share * (whole - sum(map(size, sides)))
        found.append(_Cut(saved / max(1, len(sides) - 1), cut))
    return max(found, key=lambda cut: cut.saved)


def _volume(part: Points, capsules: float = 0.0) -> float:
    """Volume [m³] of a part's hull, plus the weighted volume of a capsule around it."""
    points = extreme_points(part.reshape(-1, 3))
    return hull_volume(points) + (capsules and capsules * volume(guess(points)))


def _empty(part: Points) -> float:
    """Volume [m³] between triangles (N, 3, 3), which face outwards, and the surface of their hull."""
    hull = hull_of(extreme_points(part.reshape(-1, 3)))
    if hull is None:
        return 0.0
    normals = np.cross(part[:, 1] - part[:, 0], part[:, 2] - part[:, 0])  # of twice the triangles' areas
    room = -(part.mean(1) @ hull.equations[:, :3].T + hull.equations[:, 3]).clip(max=0.0)
    toward = normals @ hull.equations[:, :3].T  # ray by ray, facet by facet
    ahead = np.where(toward > _ALONG * np.linalg.norm(normals, axis=1)[:, None], toward, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        way = np.nan_to_num(room / ahead, nan=np.inf).min(1)  # times the normal
    return float((way * np.square(normals).sum(1))[np.isfinite(way)].sum() / 2)


def _sides(part: Points, planes: Sequence[CutPlane]) -> list[Points]:
    """Nonempty parts on all sides of the planes."""
    sides = [part]
    for normal, height in planes:
        sides = [half for side in sides for half in split_triangles(side, normal, height)]
    return [side for side in sides if len(side)]
