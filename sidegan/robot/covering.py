"""Meshes cut into parts, each with a capsule and a convex hull around it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sidegan.robot.capsule_fit import (
    DIRECTIONS,
    Points,
    Segment,
    axes,
    corners,
    extremes,
    fit,
    from_segment,
    guess,
    hull_volume,
)
from sidegan.robot.splitting import cut_further

_FINE = 12  # edges are at most this part of a mesh's size, so that planes can cut it
_SAMPLE = 3_000  # triangles that the cuts are chosen by
_PROBES = 1_024  # points that measure the volume of a union
_PAD = 0.35  # of the size, around the mesh, where these lie
_CUTS = np.linspace(0.12, 0.88, 9)  # where an axis is cut, as a share of the extent along it
_WORTH = 0.02  # share of the volumes that one more part must save
_TRIED = 2  # parts, the largest, that are tried to be cut


@dataclass(frozen=True)
class Part:
    """Some of a mesh's triangles: what holds them."""

    ends: Points  # of the capsule's axis [m], (2, 3)
    radius: float  # of the capsule [m]
    corners: Points  # whose convex hull holds the triangles [m], (V, 3)

    @property
    def capsule(self) -> Segment:
        """End points and radius of the capsule."""
        return self.ends, self.radius


def cover(meshes: Sequence[Points], most: int, further: int = 0) -> list[Part]:
    """Parts of a link's meshes with capsules and hulls that each triangle is within one of.

    Triangles go to parts as a whole: capsules and hulls are convex, and hold a triangle whose corners they
    hold. Several meshes are parts of their own, where there are at most so many: who drew them cut where it
    bends. Parts are cut by planes, where that makes the union of the capsules and the hulls smallest.

    Args:
        meshes: corners of the triangles of each mesh [m], (N, 3, 3).
        most: parts of one mesh, or of so many that they are taken together; each other mesh adds one.
        further: parts that these are then cut into at most, to leave out what only hulls hold.
    """
    edge = float(np.ptp(np.concatenate(meshes).reshape(-1, 3), axis=0).max()) / _FINE
    groups = [
        subdivided(mesh, edge) for mesh in (meshes if len(meshes) <= most else [np.concatenate(meshes)])
    ]
    fine, owner = np.concatenate(groups), np.repeat(np.arange(len(groups)), [len(group) for group in groups])
    cutter = _Cutter([_sample(group) for group in groups])
    middles = fine.mean(1)
    for _ in range(most - 1):
        cut = cutter.cut()
        if cut is None:
            break
        part, axis, height = cut
        owner[(owner == part) & (middles @ axis >= height)] = cutter.count - 1
    parts = [fine[owner == k] for k in range(cutter.count) if (owner == k).any()]
    return [_part(part) for part in (cut_further(parts, further) if further > len(parts) else parts)]


def _part(triangles: Points) -> Part:
    """Capsule and hull of triangles."""
    outer = corners(triangles.reshape(-1, 3))
    ends, radius = fit(outer)
    return Part(ends, max(radius, float(from_segment(ends, triangles.reshape(-1, 3)).max())), outer)


def subdivided(triangles: Points, edge: float) -> Points:
    """Triangles with edges no longer than this [m], (M, 3, 3), that make up the same surface."""
    done = []
    while len(triangles):
        sides = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
        longest, rows = sides.argmax(1), np.arange(len(triangles))
        large = sides[rows, longest] > edge
        done.append(triangles[~large])
        rows, longest, triangles = rows[: large.sum()], longest[large], triangles[large]
        a, b, c = (triangles[rows, (longest + k) % 3] for k in range(3))
        middle = (a + b) / 2
        triangles = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
    return np.concatenate(done)


def _sample(triangles: Points) -> Points:
    """Some triangles of many: every so manieth, and the outermost."""
    if len(triangles) <= _SAMPLE:
        return triangles
    points = triangles.reshape(-1, 3)
    chosen = np.linspace(0, len(triangles) - 1, _SAMPLE).astype(int)
    outermost = np.argmax(points @ DIRECTIONS.T, axis=0) // 3
    return triangles[np.unique(np.concatenate([chosen, outermost]))]


class _Cutter:
    """Triangles (N, 3, 3) in parts, and the capsules and hulls around these as they are cut further."""

    def __init__(self, groups: Sequence[Points]) -> None:
        from scipy.stats import qmc  # takes a second to import

        self.triangles = triangles = np.concatenate(groups)
        self.middles = triangles.mean(1)
        self.owner = np.repeat(np.arange(len(groups)), [len(group) for group in groups])
        low, high = triangles.min((0, 1)), triangles.max((0, 1))
        low, size = low - _PAD * (high - low).max(), high - low + 2 * _PAD * (high - low).max()
        self.probes = low + size * qmc.Sobol(3, scramble=False).random(_PROBES)
        self.cell = float(np.prod(size)) / _PROBES  # volume that each stands for [m³]
        self.filled: list[Points] = []  # how far each is inside of a part's capsule, from 0 to 1, (P,)
        self.hulls: list[float] = []  # volumes [m³]
        for part, group in enumerate(groups):
            self._put(part, group)

    @property
    def count(self) -> int:
        """Number of parts."""
        return len(self.filled)

    def _put(self, part: int, triangles: Points) -> None:
        """Take a part in, in the place of the one that was there."""
        points = triangles.reshape(-1, 3)
        self.filled[part : part + 1] = [self._filled(fit(points))]
        self.hulls[part : part + 1] = [hull_volume(points)]

    def _filled(self, capsule: Segment) -> Points:
        ends, radius = capsule
        return np.clip((radius - from_segment(ends, self.probes)) / np.cbrt(self.cell) + 0.5, 0.0, 1.0)

    def cut(self) -> tuple[int, Points, float] | None:
        """Cut one part in two: which, the plane's normal, and its height; None where no cut is worth it."""
        whole = self.cell * float(np.max(self.filled, axis=0).sum()) + sum(self.hulls)
        largest = np.argsort([-f.sum() for f in self.filled])[:_TRIED]
        found = [cut for part in largest for cut in self._cuts(int(part))]
        if not found:
            return None
        size, part, axis, height = min(found, key=lambda one: one[0])
        if size > (1 - _WORTH) * whole:
            return None
        beyond = (self.owner == part) & (self.middles @ axis >= height)
        self.owner[beyond] = self.count
        for changed in (part, self.count):
            self._put(changed, self.triangles[self.owner == changed])
        return part, axis, height

    def _cuts(self, part: int) -> list[tuple[float, int, Points, float]]:
        """Volumes [m³] after each possible cut of a part: of the union of the capsules and of the hulls."""
        mine = self.triangles[self.owner == part]
        others = np.max([np.zeros(_PROBES), *(f for k, f in enumerate(self.filled) if k != part)], axis=0)
        hulls = sum(self.hulls) - self.hulls[part]
        cuts = []
        for axis in axes(extremes(mine.reshape(-1, 3))):
            along = mine.mean(1) @ axis
            heights = along.min() + np.ptp(along) * _CUTS
            slab = np.searchsorted(heights, along, side="right")
            outer = [extremes(mine[slab == k].reshape(-1, 3)) for k in range(len(_CUTS) + 1)]
            for k, height in enumerate(heights):
                sides = np.concatenate(outer[: k + 1]), np.concatenate(outer[k + 1 :])
                if min(map(len, sides)):
                    union = np.maximum.reduce([others, *(self._filled(guess(side)) for side in sides)])
                    size = self.cell * float(union.sum()) + hulls + sum(map(hull_volume, sides))
                    cuts.append((size, part, axis, float(height)))
        return cuts
