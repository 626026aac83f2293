"""Placement and distances of an arm's capsules in many configurations, and inflated capsules."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from sidegan.base.arrays import Array
from sidegan.kernels.chain import Chain, Shapes
from sidegan.motion.arrays import array, chain_of, shapes_of
from sidegan.robot import Arm
from sidegan.validity.regions import tables


def place_points(arm: Arm, q: Array, points: Array, links: Array) -> Array:
    """World positions [m], (3, K, N), of points (K, 3) fixed to links (K,), -1 for the base, at (J, N)."""
    fixed, sine, cosine, origin, slide = (x[..., None] for x in chain_of(arm)[1:6])
    turns = [np.broadcast_to(np.eye(3)[..., None], (3, 3, q.shape[1]))]
    places = [np.zeros((3, q.shape[1]))]
    for i, x in enumerate(q):
        turn = (fixed[i] + sine[i] * np.sin(x) + cosine[i] * np.cos(x)).reshape(3, 3, -1)
        places.append(places[-1] + (turns[-1] * (origin[i] + slide[i] * x)).sum(1))
        turns.append((turns[-1][:, :, None] * turn).sum(1))
    own = np.stack(turns)[links + 1], np.stack(places)[links + 1]  # of each point's frame
    return np.einsum("kijn,kj->ikn", own[0], points) + own[1].swapaxes(0, 1)


def clearances(chain: Chain, shapes: Shapes, q: Array) -> tuple[Array, Array]:
    """Signed distances [m] of capsule pairs, (N, P), and of guarded ones from regions, (N, K), at (N, J).

    Distances of two nearly coincident segments are accurate to 1e-7 of a length in the worst case.
    """
    from sidegan.kernels import bodies as kernel

    found = tuple(np.empty((len(q), len(x))) for x in (shapes.pairs, shapes.guarded))
    kernel.clearances(chain, shapes, array(q), *found, kernel.place_for(shapes, q.shape[1]))
    return found[0], found[1]


def capsule_distances(arm: Arm, q: Array, pairs: Array) -> Array:
    """Signed distances [m], (N, P), of pairs of capsules (P, 2) at positions (N, J)."""
    return clearances(chain_of(arm), shapes_alone(arm, pairs), q)[0]


def shapes_alone(arm: Arm, pairs: Array) -> Shapes:
    """Capsules and pairs of them, (P, 2), without regions, for compiled kernels."""
    return shapes_of(arm.capsules, pairs, np.zeros((0, 2), dtype=int), tables(()))


@lru_cache(maxsize=16)
def thicker(arm: Arm, clearance: float) -> Arm:
    """The arm with its shapes inflated by half a clearance [m]; the arm itself for zero."""
    if not clearance:
        return arm
    half = clearance / 2
    capsules = arm.capsules
    pieces = capsules.pieces
    if pieces is not None:
        pieces = replace(pieces, radius=pieces.radius + half, core=pieces.core + half)
    return replace(arm, capsules=replace(capsules, radius=capsules.radius + half, pieces=pieces))
