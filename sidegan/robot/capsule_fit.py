"""The smallest capsule around points: a quick guess along an axis, and the refinement of its end points."""

import numpy as np
import scipy  # its parts are imported when they are used
from numpy.typing import NDArray

Points = NDArray[np.float64]
Segment = tuple[Points, float]  # end points [m], (2, 3), and the radius [m] around the segment between them

_GROWN = 1 + 1e-12  # of a radius, so that rounding leaves no point outside
_RADII = 12  # tried between the thinnest capsule along an axis and a sphere
_WIDER = 0.6  # how far towards the sphere they go
_MANY = 100  # points, above which the extreme ones stand for all in a guess
_ROUNDS = ((0.1, 250), (0.03, 250))  # of refinement: first step, as a share of the size, and evaluations


def _directions(count: int) -> Points:
    """Unit vectors, (count, 3), spread evenly: a Fibonacci lattice."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], 1)


DIRECTIONS = _directions(72)


def from_segment(ends: Points, points: Points) -> Points:
    """Distances [m], (N,), of points (N, 3) from a segment with end points (2, 3)."""
    along = ends[1] - ends[0]
    share = np.clip((points - ends[0]) @ along / max(along @ along, 1e-300), 0.0, 1.0)
    return np.linalg.norm(points - ends[0] - share[:, None] * along, axis=1)


def volume(segment: Segment) -> float:
    """Volume [m³] of a capsule."""
    ends, radius = segment
    return float(np.pi * radius**2 * (4 / 3 * radius + np.linalg.norm(ends[1] - ends[0])))


def around(ends: Points, points: Points) -> Segment:
    """The capsule with these ends, (2, 3), that just holds the points (N, 3)."""
    return ends, float(from_segment(ends, points).max()) * _GROWN + 1e-12


def extremes(points: Points) -> Points:
    """The outermost points in many directions; all of them where there are few."""
    if len(points) <= _MANY:
        return points
    return points[np.unique(np.argmax(points @ DIRECTIONS.T, axis=0))]


def corners(points: Points) -> Points:
    """The corners of the points' convex hull; all of them, each once, where they lie in a plane."""
    try:
        return points[scipy.spatial.ConvexHull(points).vertices]
    except (scipy.spatial.QhullError, ValueError):
        return np.unique(points, axis=0)


def hull_volume(points: Points) -> float:
    """Volume [m³] of the points' convex hull; 0 where they lie in a plane."""
    try:
        return float(scipy.spatial.ConvexHull(points).volume)
    except (scipy.spatial.QhullError, ValueError):
        return 0.0


def axes(points: Points) -> Points:
    """The coordinate axes and the points' principal directions, (6, 3)."""
    return np.concatenate([np.eye(3), np.linalg.svd(points - points.mean(0), full_matrices=False)[2]])


def guess(points: Points) -> Segment:
    """A small capsule around points (N, 3), along one of their axes."""
    return min(guesses(points), key=volume)


def guesses(points: Points) -> list[Segment]:
    """A small capsule around points (N, 3) along each of their axes."""
    points = extremes(points)
    return [around(_along(points, axis), points) for axis in axes(points)]


def _along(points: Points, axis: Points) -> Points:
    """End points, (2, 3), of a small capsule along an axis, (3,)."""
    across = points - np.outer(points @ axis, axis)
    foot = (across.max(0) + across.min(0)) / 2
    foot = foot - (foot @ axis) * axis
    along, beside = points @ axis, np.linalg.norm(across - foot, axis=1)
    middle = (along.max() + along.min()) / 2
    thin, wide = beside.max(), np.hypot(beside, along - middle).max()
    radius = thin + (wide - thin) * _WIDER * np.arange(_RADII) / _RADII
    cap = np.sqrt(np.maximum(radius[:, None] ** 2 - beside**2, 0.0))  # how far round ends reach over a point
    low, high = (along + cap).min(1), (along - cap).max(1)
    length = np.maximum(high - low, 0.0)
    volumes = [*(radius**2 * (4 / 3 * radius + length)), 4 / 3 * wide**3]
    best = int(np.argmin(volumes))
    if best == _RADII:
        place = np.array([middle, middle])
    elif low[best] > high[best]:
        place = np.full(2, (low[best] + high[best]) / 2)
    else:
        place = np.array([low[best], high[best]])
    return foot + np.outer(place, axis)


def fit(points: Points) -> Segment:
    """A capsule around points (N, 3) of nearly the smallest volume, by Nelder and Mead's method."""
    from scipy.optimize import minimize  # takes half a second to import

    outer = corners(points)
    size = float(np.ptp(outer, axis=0).max()) + 1e-9

    def cost(x: Points) -> float:
        ends = x.reshape(2, 3)
        return volume((ends, float(from_segment(ends, outer).max())))

    best = min(guesses(outer), key=lambda one: cost(one[0].ravel()))[0].ravel()
    for step, evaluations in _ROUNDS:
        start = np.concatenate([best[None], best + step * size * np.eye(6)])
        fine = {"xatol": 1e-5 * size, "fatol": 1e-3 * cost(best)}
        options = {"initial_simplex": start, "maxfev": evaluations, **fine}
        found = minimize(cost, best, method="Nelder-Mead", options=options)
        best = min(best, found.x, key=cost)
    return around(best.reshape(2, 3), outer)
