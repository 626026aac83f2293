"""Distances of the convex pieces inside capsules, and proofs that pairs never touch; compiled."""

import math
from typing import TYPE_CHECKING

import numpy as np

from sidegan.base.arrays import Array
from sidegan.kernels.chain import Shapes
from sidegan.motion.arrays import array, chain_of
from sidegan.robot import Arm
from sidegan.robot.fitting import from_segment
from sidegan.validity.bounds import Reaches
from sidegan.validity.capsules import shapes_alone

if TYPE_CHECKING:
    from sidegan.kernels.bodies import Bodies

_BUDGET = (100_000, 20_000, 2_000)  # boxes for a pair with one, two, and more joints between them
_DEPTH = 512  # most boxes in the queue
_GAP = 1e-6  # [m] least distance to prove, far above rounding errors


def bodies_of(arm: Arm, shapes: Shapes) -> "Bodies":
    """An arm's capsules, pairs and regions with the pieces inside the capsules, for compiled kernels."""
    from sidegan.kernels.bodies import Bodies
    from sidegan.kernels.gjk import Hulls

    capsules, pieces = arm.capsules, arm.capsules.pieces
    if pieces is None:
        hulls = Hulls.none(len(capsules.radius), len(shapes.pairs))
    else:
        each = zip(capsules.a, capsules.b, np.split(pieces.corners, pieces.start[1:-1]))
        around = np.array([from_segment(np.stack([a, b]), corners).max() for a, b, corners in each])
        finer = ~np.all(pieces.exact[shapes.pairs], 1)
        hulls = Hulls(*map(array, (pieces.corners, pieces.start, pieces.radius, around, finer)))
    return Bodies(chain_of(arm), shapes, hulls)


def piece_distances(bodies: "Bodies", q: Array, asked: Array, need: float = math.inf) -> Array:
    """Lower bounds of distances [m], (M,), accurate to 1e-8 m; minus infinity where pieces touch.

    Like those of capsules, they are larger by what a pair may be closer.

    Args:
        bodies: the arm with its pieces.
        q: positions [rad or m], (N, J).
        asked: row of ``q``, ascending, and pair of each query, (M, 2).
        need: distance [m] above which bounds need not be accurate.
    """
    from sidegan.kernels import bodies as kernel

    found = np.empty(len(asked))
    if len(asked):
        room = kernel.place_for(bodies.shapes, q.shape[1])
        kernel.distances(bodies, array(q), array(asked), need, found, room)
    return found


def never_touching(arm: Arm, pairs: Array) -> Array:
    """Whether pairs of capsules, (P, 2), provably never touch within the joint limits, (P,) bool.

    Branch and bound over boxes of joint positions, with the same motion bounds as the check of
    trajectories. Only for arms with pieces; pairs for which the proof takes too long may touch.
    """
    from sidegan.kernels import bodies as kernel

    found = np.zeros(len(pairs), bool)
    if not len(pairs) or arm.capsules.pieces is None:
        return found
    bodies = bodies_of(arm, shapes_alone(arm, pairs))
    reach = array(Reaches.of(arm, pairs, pairs[:0]).pieces)
    link = arm.capsules.link[pairs]
    work = np.empty((2, _DEPTH, arm.joints))
    room = kernel.place_for(bodies.shapes, arm.joints)
    for p, joints in enumerate(np.abs(link[:, 0] - link[:, 1]).tolist()):
        work[0, 0] = (arm.position_upper + arm.position_lower) / 2
        work[1, 0] = (arm.position_upper - arm.position_lower) / 2
        budget = _BUDGET[min(joints, len(_BUDGET)) - 1]
        found[p] = kernel.never_touch(bodies, reach, p, _GAP, work, budget, room)
    return found
