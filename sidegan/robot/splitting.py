"""Parts of a mesh cut further, exactly at planes, where that leaves out most of what only hulls hold."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sidegan.robot.capsule_fit import Points, axes, extremes, hull_volume

_SAMPLE = 600  # triangles that cuts are chosen by
_CUTS = np.linspace(0.14, 0.86, 7)  # where an axis is cut, as a share of the extent along it
_LITTLE = 1e-3  # share of all hulls' volume that a cut must save

Plane = tuple[Points, float]  # a normal, (3,), and the height of the plane along it


@dataclass(frozen=True)
class _Cut:
    """How a part is cut best: volume of hulls that each added part saves [m³], and the planes."""

    saved: float
    planes: tuple[Plane, ...]


def cut_further(parts: Sequence[Points], most: int) -> list[Points]:
    """Parts, triangles (N, 3, 3) each, cut by planes into at most so many that leave out most empty space.

    Triangles that a plane passes through are divided there, so that no part reaches beyond its planes.
    """
    found = [part for part in parts if len(part)]
    cuts = [_best(part) for part in found]
    enough = _LITTLE * sum(hull_volume(extremes(part.reshape(-1, 3))) for part in found)
    while True:
        fitting = [k for k, cut in enumerate(cuts) if len(found) + 2 ** len(cut.planes) - 1 <= most]
        k = max(fitting, key=lambda one: cuts[one].saved, default=-1)
        if k < 0 or not cuts[k].saved > enough:
            return found
        sides = _sides(found[k], cuts[k].planes)
        found[k : k + 1], cuts[k : k + 1] = sides, [_best(side) for side in sides]


def _best(part: Points) -> _Cut:
    """The best cut of a part: by one plane, or into quarters, which opens a ring where halves do not."""
    points = part.reshape(-1, 3)
    chosen = np.linspace(0, len(part) - 1, min(len(part), _SAMPLE)).astype(int)
    outermost = np.unique(np.argmax(points @ axes(extremes(points)).T, axis=0) // 3)
    sample = part[np.union1d(chosen, outermost)]
    outer = extremes(sample.reshape(-1, 3))
    whole = hull_volume(outer)
    if not whole:  # flat: there is nothing to leave out
        return _Cut(0.0, ())
    ways = axes(outer)
    low, size = (outer @ ways.T).min(0), np.ptp(outer @ ways.T, axis=0)
    planes = [((axis, float(h)),) for axis, a, s in zip(ways, low, size) for h in a + s * _CUTS]
    middles = [(axis, float(a + s / 2)) for axis, a, s in zip(ways, low, size)]
    quarters = [(middles[i], middles[k]) for i, k in ((0, 1), (0, 2), (1, 2), (3, 4), (3, 5), (4, 5))]
    return max((_judged(sample, whole, cut) for cut in (*planes, *quarters)), key=lambda cut: cut.saved)


def _judged(part: Points, whole: float, planes: tuple[Plane, ...]) -> _Cut:
    sides = _sides(part, planes)
    left = sum(hull_volume(extremes(side.reshape(-1, 3))) for side in sides)
    return _Cut((whole - left) / max(1, len(sides) - 1), planes)


def _sides(part: Points, planes: Sequence[Plane]) -> list[Points]:
    """What lies on the sides of planes, where something does."""
    sides = [part]
    for normal, height in planes:
        sides = [half for side in sides for half in split(side, normal, height)]
    return [side for side in sides if len(side)]


def split(triangles: Points, normal: Points, height: float) -> tuple[Points, Points]:
    """Triangles (N, 3, 3) below and above a plane; those that it passes through are divided."""
    over = triangles @ normal - height
    below, above = (over <= 0).all(1), (over >= 0).all(1)
    crossed = ~below & ~above
    t, s = triangles[crossed], over[crossed]
    up = s > 0
    alone = np.where(up.sum(1) == 1, up.argmax(1), (~up).argmax(1))  # the corner that is on a side of its own
    order = (alone[:, None] + np.arange(3)) % 3
    (a, b, c), (sa, sb, sc) = (
        np.take_along_axis(t, order[..., None], 1).transpose(1, 0, 2),
        np.take_along_axis(s, order, 1).T[..., None],
    )
    p, q = a + sa / (sa - sb) * (b - a), a + sa / (sa - sc) * (c - a)
    tip, rest = np.stack([a, p, q], 1), np.stack([np.stack([p, b, c], 1), np.stack([p, c, q], 1)], 1)
    high = sa[:, 0] > 0
    return (
        np.concatenate([triangles[below], tip[~high], rest[high].reshape(-1, 3, 3)]),
        np.concatenate([triangles[above & ~below], tip[high], rest[~high].reshape(-1, 3, 3)]),
    )
