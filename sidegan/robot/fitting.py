"""Small capsules and convex hulls that contain points without exception."""

import numpy as np
import scipy  # submodules load lazily
from numpy.typing import NDArray

Points = NDArray[np.float64]
Capsule = tuple[Points, float]  # end points [m], (2, 3), and the radius [m] around the segment between them

_GROWN = 1 + 1e-12  # factor on radii, so that rounding leaves no point outside
_RADII = 12  # tried between the thinnest capsule along an axis and a sphere
_WIDER = 0.6  # share of the way to the sphere that these cover
_MANY = 100  # points above which only extreme ones are used in a guess
_ROUNDS = ((0.1, 250), (0.03, 250))  # of refinement: initial step as a share of the size, and evaluations
_ADDED = 40  # rounds of adding corners to a hull
_AT_ONCE = 200_000  # pairs of points and triangles processed together
_SPARED = 1e-10  # [m] by which qhull may leave points out of a hull


def _directions(count: int) -> Points:
    """Unit vectors, (count, 3), spread evenly: a Fibonacci lattice."""
    k = np.arange(count) + 0.5
    z = 1 - 2 * k / count
    turn = np.pi * (1 + 5**0.5) * k
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], 1)


DIRECTIONS = _directions(72)


def from_segment(ends: Points, points: Points) -> Points:
    """Distances [m], (N,), of points (N, 3) from a segment with end points (2, 3)."""
    along = ends[1] - ends[0]
    share = np.clip((points - ends[0]) @ along / max(along @ along, 1e-300), 0.0, 1.0)
    return np.linalg.norm(points - ends[0] - share[:, None] * along, axis=1)


def volume(segment: Capsule) -> float:
    """Volume [m³] of a capsule."""
    ends, radius = segment
    return float(np.pi * radius**2 * (4 / 3 * radius + np.linalg.norm(ends[1] - ends[0])))


def around(ends: Points, points: Points) -> Capsule:
    """Smallest capsule with these ends, (2, 3), that contains points (N, 3)."""
    return ends, float(from_segment(ends, points).max()) * _GROWN + 1e-12


def extreme_points(points: Points) -> Points:
    """The outermost points in many directions; all points if there are few."""
    if len(points) <= _MANY:
        return points
    return points[np.unique(np.argmax(points @ DIRECTIONS.T, axis=0))]


def hull_of(points: Points) -> "scipy.spatial.ConvexHull | None":
    """Convex hull of points; None if they lie in a plane."""
    try:
        return scipy.spatial.ConvexHull(points)
    except (scipy.spatial.QhullError, ValueError):
        return None


def corners(points: Points) -> Points:
    """Corners of the convex hull of points; all distinct points if they lie in a plane."""
    hull = hull_of(points)
    return np.unique(points, axis=0) if hull is None else points[hull.vertices]


def inflated(points: Points, by: float) -> Points:
    """Corners of cubes around points (N, 3), (8 N, 3): their hull contains that of inflated points [m]."""
    cube = np.array(np.meshgrid([-by, by], [-by, by], [-by, by])).reshape(3, 8).T
    return (points[:, None] + cube).reshape(-1, 3)


def hull_volume(points: Points) -> float:
    """Volume [m³] of the convex hull of points; 0 if they lie in a plane."""
    hull = hull_of(points)
    return 0.0 if hull is None else float(hull.volume)


def axes(points: Points) -> Points:
    """Coordinate axes and principal directions of points, (6, 3)."""
    return np.concatenate([np.eye(3), np.linalg.svd(points - points.mean(0), full_matrices=False)[2]])


def guess(points: Points) -> Capsule:
    """A small capsule along one of their axes around points (N, 3), or around the outermost of many."""
    outer = extreme_points(points)
    return min((around(ends_along(outer, axis), outer) for axis in axes(outer)), key=volume)


def nearly_fit(points: Points) -> Capsule:
    """Capsule around points (N, 3), along the best of a few axes."""
    return around(guess(points)[0], points)


def fit_capsule(points: Points) -> Capsule:
    """Capsule around points (N, 3) of nearly the smallest volume, by Nelder and Mead's method."""
    outer = corners(points)
    size = float(np.ptp(outer, axis=0).max()) + 1e-9

    def cost(x: Points) -> float:
        ends = x.reshape(2, 3)
        return volume((ends, float(from_segment(ends, outer).max())))

    best = guess(outer)[0].ravel()
    for step, evaluations in _ROUNDS:
        start = np.concatenate([best[None], best + step * size * np.eye(6)])
        fine = {"xatol": 1e-5 * size, "fatol": 1e-3 * cost(best)}
        options = {"initial_simplex": start, "maxfev": evaluations, **fine}
        found = scipy.optimize.minimize(cost, best, method="Nelder-Mead", options=options)
        best = min(best, found.x, key=cost)
    return around(best.reshape(2, 3), outer)


def ends_along(points: Points, axis: Points) -> Points:
    """End points, (2, 3), of a small capsule along an axis, (3,)."""
    across = points - np.outer(points @ axis, axis)
    foot = (across.max(0) + across.min(0)) / 2
    foot = foot - (foot @ axis) * axis
    height = points @ axis
    beside = np.linalg.norm(across - foot, axis=1)
    middle = (height.max() + height.min()) / 2
    thin, wide = beside.max(), np.hypot(beside, height - middle).max()
    radius = thin + (wide - thin) * _WIDER * np.arange(_RADII) / _RADII
    cap = np.sqrt(np.maximum(radius[:, None] ** 2 - beside**2, 0.0))  # of round ends beyond a point
    low = (height + cap).min(1)
    high = (height - cap).max(1)
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


def simplify_hull(points: Points, tolerance: float) -> tuple[Points, float]:
    """Some corners of the hull of points, (V, 3), and the largest distance of the others from their hull [m].

    The hull of the points is within that distance of the corners' hull. Points in a plane are all kept.

    Args:
        points: of a convex body [m], (N, 3).
        tolerance: distance [m] above which corners are added.
    """
    try:
        kept = np.unique(np.argmax(points @ DIRECTIONS.T, axis=0))
        for _ in range(_ADDED):
            hull = scipy.spatial.ConvexHull(points[kept])
            beyond = points @ hull.equations[:, :3].T + hull.equations[:, 3]
            worst = np.unique(beyond.argmax(0)[beyond.max(0) > tolerance])
            if not len(worst):
                break
            kept = np.unique(np.concatenate([kept[hull.vertices], worst]))
        hull = scipy.spatial.ConvexHull(points[kept])
    except (scipy.spatial.QhullError, ValueError):
        return points, 0.0
    outside = points[(points @ hull.equations[:, :3].T + hull.equations[:, 3]).max(1) > 0]
    return points[kept[hull.vertices]], _farthest(outside, points[kept], hull.simplices) + _SPARED


def _farthest(points: Points, vertices: Points, faces: NDArray[np.int32]) -> float:
    """Largest distance [m] of points (N, 3) from a surface; 0 without points."""
    import trimesh

    surface = trimesh.Trimesh(vertices, faces, process=False)
    rows = max(1, _AT_ONCE // len(faces))
    parts = [points[k : k + rows] for k in range(0, len(points), rows)]
    away = [trimesh.proximity.closest_point_naive(surface, part)[1] for part in parts]
    return max((float(distances.max()) for distances in away), default=0.0)


def split_triangles(triangles: Points, normal: Points, height: float) -> tuple[Points, Points]:
    """Triangles (N, 3, 3) below and above a plane, divided where it crosses them."""
    over = triangles @ normal - height
    below, above = (over <= 0).all(1), (over >= 0).all(1)
    crossed = ~below & ~above
    t, s = triangles[crossed], over[crossed]
    up = s > 0
    alone = np.where(up.sum(1) == 1, up.argmax(1), (~up).argmax(1))  # the corner that is alone on its side
    order = (alone[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(t, order[..., None], 1).transpose(1, 0, 2)
    sa, sb, sc = np.take_along_axis(s, order, 1).T[..., None]
    p, q = a + sa / (sa - sb) * (b - a), a + sa / (sa - sc) * (c - a)
    tip = np.stack([a, p, q], 1)
    rest = np.concatenate([np.stack([p, b, c], 1), np.stack([p, c, q], 1)])
    high = sa[:, 0] > 0
    twice = np.concatenate([high, high])
    return (
        np.concatenate([triangles[below], tip[~high], rest[twice]]),
        np.concatenate([triangles[above & ~below], tip[high], rest[~twice]]),
    )
