"""How far apart the convex pieces inside of capsules are, and which provably never touch; compiled."""

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from sidegan.base.arrays import Array
from sidegan.motion.arrays import array, chain_of
from sidegan.robot import Arm, Capsules
from sidegan.robot.arm import Pieces
from sidegan.validity.bounds import Reaches
from sidegan.validity.capsules import shapes_alone

if TYPE_CHECKING:
    from sidegan.kernels.gjk import Hulls

_BUDGET = (100_000, 20_000, 2_000)  # boxes for a pair with one, two, and more joints between them
_DEPTH = 512  # boxes that wait at most
_GAP = 1e-6  # [m] that must be left, far above what rounding makes


class PieceDistances:
    """Distances of the pieces of pairs of capsules.

    Args:
        arm: whose pieces they are.
        pairs: of capsules, (P, 2).

    Attributes:
        finer: whether the pieces of a pair may be farther apart than its capsules, (P,) bool.
    """

    def __init__(self, arm: Arm, pairs: Array) -> None:
        self.arm, self.pairs = arm, pairs
        self.pieces = arm.capsules.pieces
        self.finer = np.zeros(len(pairs), bool)
        if self.pieces is not None:
            self.finer = ~np.all(self.pieces.exact[pairs], 1)

    def lower(self, q: Array, asked: Array, need: float = float("inf")) -> Array:
        """Lower bounds of distances [m], (M,), exact but for 1e-8 m; minus infinity where pieces touch.

        Args:
            q: positions [rad or m], (N, J).
            asked: row and pair of each question, (M, 2).
            need: a bound that is enough, as precise as it may be.
        """
        if self.pieces is None or not len(asked):
            return np.full(len(asked), -np.inf)
        from sidegan.kernels import bodies as kernel

        order = np.argsort(asked[:, 0], stable=True)
        shapes = shapes_alone(self.arm, self.pairs)
        out = np.empty(len(asked))
        room = kernel.place_for(shapes, self.arm.joints)
        bodies = kernel.Bodies(chain_of(self.arm), shapes, self.hulls)
        kernel.distances(bodies, array(q), array(asked[order]), need, out, room)
        found = np.empty(len(asked))
        found[order] = out
        return found

    @cached_property
    def hulls(self) -> "Hulls":
        """The pieces as compiled kernels take them."""
        from sidegan.kernels.gjk import Hulls

        if self.pieces is None:
            return Hulls.none(len(self.arm.capsules.radius), len(self.pairs))
        pieces, around = self.pieces, _around(self.arm.capsules, self.pieces)
        arrays = pieces.corners, pieces.start, pieces.radius, around, self.finer
        return Hulls(*map(array, arrays))


def _around(capsules: Capsules, pieces: Pieces) -> Array:
    """How far the corners of each piece are from its capsule's axis at most [m], (C,)."""
    counts = np.diff(pieces.start)
    a, along = (x.repeat(counts, 0) for x in (capsules.a, capsules.b - capsules.a))
    length = np.maximum(np.square(along).sum(1), np.finfo(float).tiny)
    share = np.clip(((pieces.corners - a) * along).sum(1) / length, 0, 1)
    apart = np.linalg.norm(a + share[:, None] * along - pieces.corners, axis=1)
    return np.maximum.reduceat(apart, pieces.start[:-1])


def never_touching(arm: Arm, pairs: Array) -> Array:
    """Which pairs of capsules, of some (P, 2), provably never touch within the joints' limits, (P,) bool.

    Branch and bound over boxes of joint positions, with the bounds on motion that the check of trajectories
    uses. Only for arms with something inside of their capsules; a pair for which the proof takes too long
    counts as one that may touch.
    """
    found = np.zeros(len(pairs), bool)
    inside = PieceDistances(arm, pairs)
    if not len(pairs) or arm.capsules.pieces is None:
        return found
    from sidegan.kernels import bodies as kernel

    bodies = kernel.Bodies(chain_of(arm), shapes_alone(arm, pairs), inside.hulls)
    reach, link = array(Reaches.of(arm, pairs, pairs[:0]).pieces), arm.capsules.link[pairs]
    middle, half = arm.position_upper + arm.position_lower, arm.position_upper - arm.position_lower
    work, room = np.empty((2, _DEPTH, arm.joints)), kernel.place_for(bodies.shapes, arm.joints)
    for p, joints in enumerate(np.abs(link[:, 0] - link[:, 1]).tolist()):
        work[0, 0], work[1, 0] = middle / 2, half / 2
        budget = _BUDGET[min(joints, len(_BUDGET)) - 1]
        found[p] = kernel.never_touch(bodies, reach, p, _GAP, work, budget, room)
    return found
