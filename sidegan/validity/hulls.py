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
    return _search(one, other)[0]


def nearest_points(one: Hull, other: Hull) -> Floats:
    """Points of two hulls [m], (N, 2, 3), that are nearest to each other; not numbers where they touch."""
    bound, weights, corners = _search(one, other)
    points = np.einsum("nk,nksi->nsi", weights, corners)
    points[~np.isfinite(bound)] = np.nan
    return points


def _search(one: Hull, other: Hull) -> tuple[Floats, Floats, Floats]:
    """The bounds, and shares (N, 4) of corners of both hulls [m], (N, 4, 2, 3), in the nearest points."""
    count = len(one[1])
    middles = [place + turn @ corners.mean(0) for corners, turn, place in (one, other)]
    v = middles[0] - middles[1]
    v = np.where(np.linalg.norm(v, axis=1, keepdims=True) > 0, v, [1.0, 0.0, 0.0])
    simplex, corners = np.zeros((count, 4, 3)), np.zeros((count, 4, 2, 3))
    weights = np.zeros((count, 4))
    bound, busy = np.full(count, -np.inf), np.arange(count)
    for step in range(_ROUNDS):
        pair = np.stack([_farthest(one, -v, busy), _farthest(other, v, busy)], 1)
        new = pair[:, 0] - pair[:, 1]
        size = np.linalg.norm(v, axis=1)
        bound[busy] = np.maximum(bound[busy], (v * new).sum(1) / size)
        known = (simplex[busy] == new[:, None]).all(2).any(1) & (step > 0)
        done = known | ((size - bound[busy] <= _CLOSE) & (step > 0))
        busy, pair, new = busy[~done], pair[~done], new[~done]
        if not len(busy):
            break
        free = np.argmin(weights[busy], axis=1)
        if step == 0:
            simplex[busy], corners[busy] = new[:, None], pair[:, None]  # all four corners are one
        simplex[busy, free], corners[busy, free] = new, pair
        inside = _holds_origin(simplex[busy])
        weights[busy], v = _nearest(simplex[busy])
        used = np.argmax(weights[busy], axis=1)
        counts = weights[busy][..., None] > 0
        simplex[busy] = np.where(counts, simplex[busy], simplex[busy, used][:, None])
        corners[busy] = np.where(counts[..., None], corners[busy], corners[busy, used][:, None])
        touching = inside | (np.linalg.norm(v, axis=1) <= _TOUCHING)
        bound[busy[touching]] = -np.inf
        busy, v = busy[~touching], v[~touching]
    return bound, weights, corners


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
    """Shares of corners (M, 1 to 3, 3) in the point of their line or plane nearest to the origin."""
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
    return np.asarray((shares > 0).all(1) | (shares < 0).all(1))
