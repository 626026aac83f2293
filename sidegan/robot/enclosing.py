"""A small capsule around a shape; never one that the shape sticks out of."""

import numpy as np
import scipy  # its parts are imported when they are used
from numpy.typing import NDArray

Points = NDArray[np.float64]
Segment = tuple[Points, float]  # end points, and the radius around the segment between them
_SAME = 1e-9  # relative difference of volumes that rounding could make
_RADII = 200  # tried between the thinnest capsule and a sphere


def around_cylinder(radius: float, half_length: float) -> Segment:
    """End points [m], (2, 3), and radius [m] of a capsule around a cylinder along z."""
    ends, wide = _around_rings(np.full(2, radius), np.array([-half_length, half_length]))
    return np.outer(ends, [0.0, 0.0, 1.0]), wide


def around_points(points: Points) -> Segment:
    """End points [m], (2, 3), and radius [m] of a capsule that holds points [m], (N, 3).

    The axis is one of the coordinate axes or of the points' principal directions, whichever gives the
    smallest volume.
    """
    corners = _corners(points)
    centred = corners - corners.mean(0)
    principal = np.linalg.svd(centred, full_matrices=False)[2]
    candidates = []
    for axis in [*np.eye(3), *principal]:
        foot = corners.mean(0) + _middle_across(centred, axis)
        along = (corners - foot) @ axis
        across = np.linalg.norm(corners - foot - np.outer(along, axis), axis=1)
        ends, radius = _around_rings(across, along)
        candidates.append((foot + np.outer(ends, axis), radius))
    lengths = [float(np.linalg.norm(ends[1] - ends[0])) for ends, _ in candidates]
    volumes = [_volume(radius, length) for (_, radius), length in zip(candidates, lengths)]
    alike = (1 + _SAME) * min(volumes)  # which of these is smallest, rounding decides: the first is taken
    return next(c for c, volume in zip(candidates, volumes) if volume <= alike)


def _around_rings(across: Points, along: Points) -> Segment:
    """Ends, (2,), on the common axis and radius of a capsule around rings, given by radius and place."""
    middle = (along.min() + along.max()) / 2
    widest = float(np.hypot(across, along - middle).max())
    candidates = [(np.full(2, middle), widest)]  # a sphere
    for radius in np.linspace(across.max(), widest, _RADII, endpoint=False):
        cap = np.sqrt(np.maximum(radius**2 - across**2, 0.0))  # how far the round end reaches over a ring
        ends = np.array([(along + cap).min(), (along - cap).max()])
        if ends[0] > ends[1]:  # a sphere anywhere between them will do
            ends = np.full(2, ends.mean())
        candidates.append((ends, float(radius)))
    return min(candidates, key=lambda c: _volume(c[1], c[0][1] - c[0][0]))


def _corners(points: Points) -> Points:
    """The corners of the points' convex hull; all points when they lie in a plane."""
    try:
        return points[scipy.spatial.ConvexHull(points).vertices]
    except (scipy.spatial.QhullError, ValueError):
        return points


def _middle_across(points: Points, axis: Points, rounds: int = 200) -> Points:
    """A point, (3,), across the axis, near the centre of the smallest circle around the points.

    Shrinking steps towards the farthest point (Badoiu and Clarkson, 2003).
    """
    flat = points - np.outer(points @ axis, axis)
    middle = flat.mean(0)
    for i in range(1, rounds + 1):
        farthest = flat[np.linalg.norm(flat - middle, axis=1).argmax()]
        middle = middle + (farthest - middle) / (i + 1)
    return middle


def _volume(radius: float, length: float) -> float:
    return float(np.pi * radius**2 * (4 / 3 * radius + length))
