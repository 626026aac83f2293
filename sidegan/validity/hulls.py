"""Distance of convex hulls by NumPy, many placements at a time: the reference of the compiled search.

The algorithm of Gilbert, Johnson and Keerthi 1988. Every search direction gives a plane between the hulls, or
shows that it is none: what comes back is the best such plane's lower bound of the distance.
"""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Hull = tuple[Floats, Floats, Floats]  # corners (V, 3), rotations (N, 3, 3) and places (N, 3) in the world

_ROUNDS = 60
_CLOSE = 1e-8  # [m] between the bounds of a distance that is known well enough
_TOUCHING = 1e-10  # [m] below it two hulls touch
_FLAT = 1e-14  # squared sine of an angle of a triangle that is none
_TINY = 1e-300
_SUBSETS = [list(corners) for size in (1, 2, 3) for corners in combinations(range(4), size)]


def apart(one: Hull, other: Hull) -> Floats:
    """Lower bounds of the distances [m], (N,), exact but for 1e-8 m; minus infinity where hulls touch."""
    count = len(one[1])
    middles = [place + turn @ corners.mean(0) for corners, turn, place in (one, other)]
    v = middles[0] - middles[1]
    v = np.where(np.linalg.norm(v, axis=1, keepdims=True) > 0, v, [1.0, 0.0, 0.0])
    simplex = np.zeros((count, 4, 3))
    weights = np.zeros((count, 4))
    bound, busy = np.full(count, -np.inf), np.arange(count)
    for step in range(_ROUNDS):
        new = _farthest(one, -v, busy) - _farthest(other, v, busy)
        size = np.linalg.norm(v, axis=1)
        bound[busy] = np.maximum(bound[busy], (v * new).sum(1) / size)
        known = (simplex[busy] == new[:, None]).all(2).any(1) & (step > 0)
        done = known | ((size - bound[busy] <= _CLOSE) & (step > 0))
        busy, new = busy[~done], new[~done]
        if not len(busy):
            break
        free = np.argmin(weights[busy], axis=1)
        if step == 0:
            simplex[busy] = new[:, None]  # all four corners are one
        simplex[busy, free] = new
        inside = _holds_origin(simplex[busy])
        weights[busy], v = _nearest(simplex[busy])
        used = np.argmax(weights[busy], axis=1)
        padding = np.repeat(simplex[busy, used][:, None], 4, axis=1)
        simplex[busy] = np.where(weights[busy][..., None] > 0, simplex[busy], padding)
        touching = inside | (np.linalg.norm(v, axis=1) <= _TOUCHING)
        bound[busy[touching]] = -np.inf
        busy, v = busy[~touching], v[~touching]
    return bound


def _farthest(hull: Hull, direction: Floats, rows: NDArray[np.int64]) -> Floats:
    """Corners in the world, (M, 3), that lie farthest in directions (M, 3), of some of the placements."""
    corners, turn, place = hull
    local = np.einsum("mji,mj->mi", turn[rows], direction)
    chosen = corners[np.argmax(local @ corners.T, axis=1)]
    return place[rows] + np.einsum("mij,mj->mi", turn[rows], chosen)


def _nearest(simplex: Floats) -> tuple[Floats, Floats]:
    """Shares of the corners, (M, 4), in the points of simplices (M, 4, 3) nearest to the origin, and these.

    Of every corner, edge and face the point nearest to the origin on its line or plane, if it is inside.
    """
    best = np.full(len(simplex), np.inf)
    weights, points = np.zeros(simplex.shape[:2]), np.zeros((len(simplex), 3))
    for subset in _SUBSETS:
        shares = _shares(simplex[:, subset])
        point = np.einsum("mk,mki->mi", shares, simplex[:, subset])
        size = np.where((shares >= 0).all(1), (point * point).sum(1), np.inf)
        nearer = size < best
        best = np.where(nearer, size, best)
        full = np.zeros_like(weights)
        full[:, subset] = shares
        weights[nearer], points[nearer] = full[nearer], point[nearer]
    return weights, points


def _shares(corners: Floats) -> Floats:
    """Shares of corners (M, 1 to 3, 3) in the point of their line or plane nearest to the origin; -1: none."""
    if corners.shape[1] == 1:
        return np.ones((len(corners), 1))
    a, b = corners[:, 0], corners[:, 1] - corners[:, 0]
    bb, ab = (b * b).sum(1), (a * b).sum(1)
    if corners.shape[1] == 2:
        share = np.where(bb > 0, -ab / np.maximum(bb, _TINY), -1.0)
        return np.stack([1 - share, share], 1)
    c = corners[:, 2] - a
    cc, bc, ac = (c * c).sum(1), (b * c).sum(1), (a * c).sum(1)
    whole = bb * cc - bc * bc
    flat = ~(whole > _FLAT * bb * cc)
    s, t = (bc * ac - cc * ab), (bc * ab - bb * ac)
    s, t = (np.where(flat, -1.0, x / np.maximum(whole, _TINY)) for x in (s, t))
    return np.stack([1 - s - t, s, t], 1)


def _holds_origin(simplex: Floats) -> NDArray[np.bool_]:
    """Whether the origin is inside of tetrahedra (M, 4, 3); never in flat ones."""
    # barycentric coordinates by Cramer's rule, all of one sign where the origin is inside
    shares = np.stack([(-1) ** k * np.linalg.det(np.delete(simplex, k, axis=1)) for k in range(4)], 1)
    return (shares > 0).all(1) | (shares < 0).all(1)
