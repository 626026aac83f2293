"""Meshes of a link, cut by planes into parts with little empty space, each within a capsule and a hull.

Results are cached on disk under the digest of the meshes.
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
    hull_of,
    hull_volume,
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
_HOLLOW, _LITTLE = 16, 0.0025  # the same limits for hollow meshes: most parts, least saving
_FINE = 3e-4  # [m] by which hulls are enlarged at most to save corners
_FINER = 3e-5  # the same for hollow meshes: some links pass within a fraction of a millimetre
_CONCAVE = 0.02  # largest concavity of parts, relative to half the size of the mesh
_MOST_PARTS = 48  # most parts of a mesh
_ROUNDING = 1e-7  # [m] within which a triangle on the surface of a part counts as inside
_log = logging.getLogger(__name__)

Planes = Points  # outward unit normals, and heights along them [m], (K, 4)
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
        hollow: 1: cut hollow meshes further, where that reduces the volume of hulls; 2: divide closed ones
            by a convex decomposition.
    """
    _log.info("fitting collision shapes to %d triangles", sum(map(len, meshes)))
    groups = [*meshes] if len(meshes) <= most else [np.concatenate(meshes)]
    parts = cut(groups, len(groups) + most - 1, _WORTH, _CAPSULES)
    if hollow == 1:
        parts = cut(parts, max(_HOLLOW, len(parts)), _LITTLE, 0.0)
    elif hollow:
        _log.info("decomposing them into convex parts: this may take minutes, but only once")
        parts = [x for group in groups for x in decomposed(group) or cut([group], _HOLLOW, _LITTLE, 0.0)]
    outer = [corners(part.reshape(-1, 3)) for part in parts]
    return [Part(fit(points), *thinned(points, _FINER if hollow else _FINE)) for points in outer]


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


def decomposed(triangles: Points) -> list[Points]:
    """Triangles (N, 3, 3) [m] divided into nearly convex, nonempty parts; empty for open meshes.

    Triangles outside all of CoACD's parts go to the nearest, so that none is lost. CoACD would have to remesh
    open meshes, which may take hours.
    """
    import coacd
    import trimesh

    mesh = trimesh.Trimesh(**trimesh.triangles.to_kwargs(triangles))
    if not mesh.is_watertight:
        return []
    coacd.set_log_level("error")
    found = coacd.run_coacd(
        coacd.Mesh(mesh.vertices, mesh.faces),
        threshold=_CONCAVE,
        max_convex_hull=_MOST_PARTS,
    )
    hulls = [hull for vertices, _ in found if (hull := hull_of(np.asarray(vertices))) is not None]
    if not hulls:
        return []
    return shared_out(triangles, [np.c_[hull.equations[:, :3], -hull.equations[:, 3]] for hull in hulls])


def shared_out(triangles: Points, bodies: list[Planes]) -> list[Points]:
    """Triangles (N, 3, 3) [m] grouped by the convex body that contains them or is nearest."""
    parts = []
    rest = triangles
    for planes in bodies:
        inside = rest
        outside = []
        for *normal, height in planes:
            inside, beyond = split(inside, np.array(normal), height + _ROUNDING)
            outside.append(beyond)
        parts.append(inside)
        rest = np.concatenate(outside)
    if len(rest):
        middles = rest.mean(1)
        depths = [(middles @ planes[:, :3].T - planes[:, 3]).max(1) for planes in bodies]
        nearest = np.argmin(depths, axis=0)
        parts = [np.concatenate([part, rest[nearest == k]]) for k, part in enumerate(parts)]
    return [part for part in parts if len(part)]
