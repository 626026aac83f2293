"""Meshes of a link, cut by planes into parts with little empty space, each within a capsule and a hull.

Results are cached on disk under the digest of the meshes.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from sidegan.robot.fitting import (
    Points,
    Segment,
    axes,
    corners,
    extremes,
    fit,
    guess,
    hull_volume,
    nearly_fit,
    split,
    thinned,
    volume,
)
from sidegan.robot.meshes import cache_folder

_PIECES = 4  # most parts of a mesh
_SAMPLE = 600  # triangles with which cuts are evaluated
_CUTS = np.linspace(0.14, 0.86, 7)  # where an axis is cut, as a share of the extent along it
_WORTH = 0.01  # least share of the total volume that each additional part must save
_CAPSULES = 0.3  # weight of capsule volumes relative to hull volumes
_HOLLOW = (16, 0.0025), (48, 0.0005)  # the same limits for each level of hollow meshes
_FINE = 3e-4  # [m] by which hulls are enlarged at most to save corners
_FINER = 3e-5  # the same for hollow meshes: some links pass within a fraction of a millimetre

Plane = tuple[Points, float]  # a normal, (3,), and the height of the plane along it


class Part(NamedTuple):
    """Body that contains some of a link's triangles, in the frame of the first mesh."""

    capsule: Segment
    corners: Points  # of a convex hull [m], (V, 3)
    rounding: float  # radius [m] by which the hull is inflated


class _Cut(NamedTuple):
    """The best cut of a part: volume [m³] saved per additional part, and the planes."""

    saved: float
    planes: tuple[Plane, ...]


def cover_of(digest: str, hollow: int, meshes: Callable[[], list[Points]]) -> list[Part]:
    """Parts of the meshes with this digest, from the cache or else from ``meshes``."""
    from joblib import Memory

    return Memory(cache_folder(), verbose=0).cache(_made, ignore=["meshes"])(digest, hollow, meshes)


def _made(digest: str, hollow: int, meshes: Callable[[], list[Points]]) -> list[Part]:
    return cover(meshes(), _PIECES, hollow)


def cover(meshes: Sequence[Points], most: int, hollow: int = 0) -> list[Part]:
    """Parts of a link's meshes, with capsules and hulls that together contain all triangles.

    Up to ``most`` meshes are separate parts, since they are usually divided sensibly.

    Args:
        meshes: corners of the triangles of each mesh [m], (N, 3, 3).
        most: most parts of a single mesh, or of many meshes taken together; each further mesh adds one.
        hollow: 1 or 2: cut hollow meshes further, within the limits of that level, where that reduces the
            volume of hulls.
    """
    groups = [*meshes] if len(meshes) <= most else [np.concatenate(meshes)]
    parts = cut(groups, len(groups) + most - 1, _WORTH, _CAPSULES)
    for count, worth in _HOLLOW[:hollow]:
        parts = cut(parts, max(count, len(parts)), worth, 0.0)
    outer = [corners(part.reshape(-1, 3)) for part in parts]
    capsule = nearly_fit if len(parts) > _HOLLOW[0][0] else fit  # many parts are small: a guess will do
    return [Part(capsule(points), *thinned(points, _FINER if hollow else _FINE)) for points in outer]


def cut(parts: Sequence[Points], most: int, worth: float, weight: float) -> list[Points]:
    """Parts, triangles (N, 3, 3) each, cut by planes into at most ``most`` with little empty space.

    Triangles are divided where a plane crosses them, so that no part reaches beyond its planes. Each
    additional part must save the share ``worth`` of the total volume, with this ``weight`` of capsules.
    """
    found = [part for part in parts if len(part)]
    cuts = [_best(part, weight) for part in found]
    enough = worth * sum(_size(extremes(part.reshape(-1, 3)), weight) for part in found)
    while True:
        fitting = [k for k, cut in enumerate(cuts) if len(found) + 2 ** len(cut.planes) - 1 <= most]
        k = max(fitting, key=lambda i: cuts[i].saved, default=-1)
        if k < 0 or not cuts[k].saved > enough:
            return found
        sides = _sides(found[k], cuts[k].planes)
        found[k : k + 1], cuts[k : k + 1] = sides, [_best(side, weight) for side in sides]


def _best(part: Points, weight: float) -> _Cut:
    """The best cut of a part: in halves, or in quarters, which open a ring where halves do not."""
    points = part.reshape(-1, 3)
    chosen = np.linspace(0, len(part) - 1, min(len(part), _SAMPLE)).astype(int)
    outermost = np.unique(np.argmax(points @ axes(extremes(points)).T, axis=0) // 3)
    sample = part[np.union1d(chosen, outermost)]
    outer = extremes(sample.reshape(-1, 3))
    whole = _size(outer, weight)
    if not hull_volume(outer):  # flat: there is nothing to leave out
        return _Cut(0.0, ())
    ways = axes(outer)
    low = (outer @ ways.T).min(0)
    size = np.ptp(outer @ ways.T, axis=0)
    planes = [((axis, float(h)),) for axis, a, s in zip(ways, low, size) for h in a + s * _CUTS]
    middles = [(axis, float(a + s / 2)) for axis, a, s in zip(ways, low, size)]
    quarters = [(middles[i], middles[k]) for i, k in ((0, 1), (0, 2), (1, 2), (3, 4), (3, 5), (4, 5))]
    found = []
    for cut in (*planes, *quarters):
        sides = _sides(sample, cut)
        left = sum(_size(extremes(side.reshape(-1, 3)), weight) for side in sides)
        found.append(_Cut((whole - left) / max(1, len(sides) - 1), cut))
    return max(found, key=lambda cut: cut.saved)


def _size(points: Points, weight: float) -> float:
    """Volume [m³] of the hull of points, plus the weighted volume of a capsule around them."""
    return hull_volume(points) + (weight and weight * volume(guess(points)))


def _sides(part: Points, planes: Sequence[Plane]) -> list[Points]:
    """Nonempty parts on all sides of the planes."""
    sides = [part]
    for normal, height in planes:
        sides = [half for side in sides for half in split(side, normal, height)]
    return [side for side in sides if len(side)]
