"""Convex hulls with few corners, and how far the shape they stand for sticks out of them."""

import numpy as np
import scipy  # its parts are imported when they are used

from sidegan.robot.capsule_fit import DIRECTIONS, Points

_ROUNDS = 40  # of adding corners
_AT_ONCE = 4_000_000  # pairs of points and triangles
_SPARED = 1e-10  # [m] what qhull may leave out of a hull as rounding


def thinned(points: Points, tolerance: float) -> tuple[Points, float]:
    """Some corners of the points' hull, (V, 3), and how far at most other points are from their hull [m].

    Whatever lies in the points' hull is within that distance of the corners' hull. Points in a plane are
    all kept.

    Args:
        points: of a convex body [m], (N, 3).
        tolerance: distance [m] above which one more corner is taken.
    """
    try:
        kept = np.unique(np.argmax(points @ DIRECTIONS.T, axis=0))
        for _ in range(_ROUNDS):
            hull = scipy.spatial.ConvexHull(points[kept])
            beyond = points @ hull.equations[:, :3].T + hull.equations[:, 3]
            worst = np.unique(beyond.argmax(0)[beyond.max(0) > tolerance])
            if not len(worst):
                break
            kept = np.unique(np.concatenate([kept[hull.vertices], worst]))
        hull = scipy.spatial.ConvexHull(points[kept])
    except (scipy.spatial.QhullError, ValueError):
        return points, 0.0
    outside = (points @ hull.equations[:, :3].T + hull.equations[:, 3]).max(1) > 0
    distance = _from_triangles(points[outside], points[kept][hull.simplices])
    return points[kept[hull.vertices]], float(distance.max(initial=0.0)) + _SPARED


def _from_triangles(points: Points, triangles: Points) -> Points:
    """Distance [m], (N,), of points (N, 3) from the nearest of some triangles (M, 3, 3)."""
    rows = max(1, _AT_ONCE // max(1, len(triangles)))
    parts = [points[k : k + rows] for k in range(0, len(points), rows)]
    return np.concatenate([np.zeros(0), *(_from_each(part, triangles).min(1) for part in parts)])


def _from_each(points: Points, triangles: Points) -> Points:
    """Distances [m], (N, M), of points from triangles: to the plane above a triangle, else to its edges."""
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    height = points @ normal.T - (normal * triangles[:, 0]).sum(1)
    above = np.ones_like(height, dtype=bool)
    edges = np.full_like(height, np.inf)
    for k in range(3):
        a, b = triangles[:, k], triangles[:, (k + 1) % 3]
        along = b - a
        inwards = np.cross(normal, along)
        above &= points @ inwards.T >= (inwards * a).sum(1)
        share = (points @ along.T - (along * a).sum(1)) / np.maximum((along * along).sum(1), 1e-300)
        foot = a + np.clip(share, 0.0, 1.0)[..., None] * along
        edges = np.minimum(edges, np.linalg.norm(points[:, None] - foot, axis=2))
    return np.where(above, np.abs(height), edges)
