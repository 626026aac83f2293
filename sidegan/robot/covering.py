"""Meshes of a link cut by planes into parts that leave out empty space; a capsule and a hull around each.

What was made is kept in a cache of the user's, under the digest of the meshes.
"""

import logging
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
    split,
    thinned,
    volume,
)
from sidegan.robot.meshes import cache_folder

_PIECES = 4  # parts of one mesh at most
_SAMPLE = 600  # triangles that cuts are chosen by
_CUTS = np.linspace(0.14, 0.86, 7)  # where an axis is cut, as a share of the extent along it
_WORTH = 0.01  # share of all volumes that each part must save
_CAPSULES = 0.3  # weight of the capsules' volumes beside the hulls'
_HOLLOW, _LITTLE = 16, 0.0025  # parts of a hollow mesh at most, and what each must save
_FINE = 3e-4  # [m] by which hulls may be larger than they need be, for fewer corners
_FINER = 3e-5  # the same of hollow ones: some links pass within a fraction of a millimetre
_log = logging.getLogger(__name__)

Plane = tuple[Points, float]  # a normal, (3,), and the height of the plane along it


class Part(NamedTuple):
    """Body that holds some of a link's triangles, in the frame of the first mesh."""

    capsule: Segment
    corners: Points  # of a convex hull [m], (V, 3)
    rounding: float  # radius [m] of the ball around each of the hull's points


class _Cut(NamedTuple):
    """How a part is cut best: volume [m³] that each added part saves, and the planes."""

    saved: float
    planes: tuple[Plane, ...]


def cover_of(digest: str, hollow: int, meshes: Callable[[], list[Points]]) -> list[Part]:
    """Parts of the meshes with this digest, which are read where the cache does not have them."""
    from joblib import Memory

    return Memory(cache_folder(), verbose=0).cache(_made, ignore=["meshes"])(digest, hollow, meshes)


def _made(digest: str, hollow: int, meshes: Callable[[], list[Points]]) -> list[Part]:
    return cover(meshes(), _PIECES, hollow)


def cover(meshes: Sequence[Points], most: int, hollow: int = 0) -> list[Part]:
    """Parts of a link's meshes with capsules and hulls that each point of a triangle is within one of.

    Several meshes are parts of their own, where there are at most so many: who drew them cut where it bends.

    Args:
        meshes: corners of the triangles of each mesh [m], (N, 3, 3).
        most: parts of one mesh, or of so many that they are taken together; each other mesh adds one.
        hollow: 1 where these are cut further, if that leaves out what only hulls hold, 2 where closed ones
            are divided among the parts of a convex decomposition.
    """
    _log.info("fitting collision shapes to %d triangles", sum(map(len, meshes)))
    groups = [*meshes] if len(meshes) <= most else [np.concatenate(meshes)]
    parts = cut(groups, len(groups) + most - 1, _WORTH, _CAPSULES)
    if hollow == 1:
        parts = cut(parts, max(_HOLLOW, len(parts)), _LITTLE, 0.0)
    elif hollow:
        from sidegan.robot.decomposition import decomposed

        _log.info("decomposing them into convex parts: this may take minutes, but only once")
        each = ((group, decomposed(group)) for group in groups)
        parts = [part for group, made in each for part in made or cut([group], _HOLLOW, _LITTLE, 0.0)]
    outer = [corners(part.reshape(-1, 3)) for part in parts]
    return [Part(fit(one), *thinned(one, _FINER if hollow else _FINE)) for one in outer]


def cut(parts: Sequence[Points], most: int, worth: float, weight: float) -> list[Points]:
    """Parts, triangles (N, 3, 3) each, cut by planes into more that leave out most empty space.

    Triangles that a plane passes through are divided there, so that no part reaches beyond its planes.

    Each more must save the share ``worth`` of all volumes; those of capsules have a weight beside the hulls'.
    """
    found = [part for part in parts if len(part)]
    cuts = [_best(part, weight) for part in found]
    enough = worth * sum(_size(extremes(part.reshape(-1, 3)), weight) for part in found)
    while True:
        fitting = [k for k, one in enumerate(cuts) if len(found) + 2 ** len(one.planes) - 1 <= most]
        k = max(fitting, key=lambda one: cuts[one].saved, default=-1)
        if k < 0 or not cuts[k].saved > enough:
            return found
        sides = _sides(found[k], cuts[k].planes)
        found[k : k + 1], cuts[k : k + 1] = sides, [_best(side, weight) for side in sides]


def _best(part: Points, weight: float) -> _Cut:
    """The best cut of a part: by one plane, or into quarters, which opens a ring where halves do not."""
    points = part.reshape(-1, 3)
    chosen = np.linspace(0, len(part) - 1, min(len(part), _SAMPLE)).astype(int)
    outermost = np.unique(np.argmax(points @ axes(extremes(points)).T, axis=0) // 3)
    sample = part[np.union1d(chosen, outermost)]
    outer = extremes(sample.reshape(-1, 3))
    whole = _size(outer, weight)
    if not hull_volume(outer):  # flat: there is nothing to leave out
        return _Cut(0.0, ())
    ways = axes(outer)
    low, size = (outer @ ways.T).min(0), np.ptp(outer @ ways.T, axis=0)
    planes = [((axis, float(h)),) for axis, a, s in zip(ways, low, size) for h in a + s * _CUTS]
    middles = [(axis, float(a + s / 2)) for axis, a, s in zip(ways, low, size)]
    quarters = [(middles[i], middles[k]) for i, k in ((0, 1), (0, 2), (1, 2), (3, 4), (3, 5), (4, 5))]
    found = []
    for one in (*planes, *quarters):
        sides = _sides(sample, one)
        left = sum(_size(extremes(side.reshape(-1, 3)), weight) for side in sides)
        found.append(_Cut((whole - left) / max(1, len(sides) - 1), one))
    return max(found, key=lambda one: one.saved)


def _size(points: Points, weight: float) -> float:
    """Volumes [m³] of the hull and of a capsule around points, as they count."""
    return hull_volume(points) + (weight and weight * volume(guess(points)))


def _sides(part: Points, planes: Sequence[Plane]) -> list[Points]:
    """Parts on the sides of planes, where there are any."""
    sides = [part]
    for normal, height in planes:
        sides = [half for side in sides for half in split(side, normal, height)]
    return [side for side in sides if len(side)]
