"""Distances of the convex pieces inside capsules, and proofs that pairs never touch; compiled."""

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from sidegan.base.arrays import Array
from sidegan.motion.arrays import array, chain_of
from sidegan.robot import Arm
from sidegan.robot.fitting import from_segment
from sidegan.validity.bounds import Reaches
from sidegan.validity.capsules import shapes_alone

if TYPE_CHECKING:
    from sidegan.kernels.bodies import Bodies
    from sidegan.kernels.gjk import Hulls

_BUDGET = (100_000, 20_000, 2_000)  # boxes for a pair with one, two, and more joints between them
_DEPTH = 512  # most boxes in the queue
_GAP = 1e-6  # [m] least distance to prove, far above rounding errors


class PieceDistances:
    """Distances of the pieces of pairs of capsules.

    Args:
        arm: the arm.
        pairs: of capsules, (P, 2).

    Attributes:
        finer: whether a pair's pieces may be farther apart than its capsules, (P,) bool.
    """

    def __init__(self, arm: Arm, pairs: Array) -> None:
        self.arm, self.pairs = arm, pairs
        pieces = arm.capsules.pieces
        self.finer = np.zeros(len(pairs), bool) if pieces is None else ~np.all(pieces.exact[pairs], 1)

    @cached_property
    def hulls(self) -> "Hulls":
        """The pieces for compiled kernels."""
        from sidegan.kernels.gjk import Hulls

        capsules = self.arm.capsules
        pieces = self.arm.capsules.pieces
        if pieces is None:
            return Hulls.none(len(capsules.radius), len(self.pairs))
        bodies = zip(capsules.a, capsules.b, np.split(pieces.corners, pieces.start[1:-1]))
        around = np.array([from_segment(np.stack([a, b]), corners).max() for a, b, corners in bodies])
        return Hulls(*map(array, (pieces.corners, pieces.start, pieces.radius, around, self.finer)))

    @cached_property
    def bodies(self) -> "Bodies":
        """The arm with its pieces for compiled kernels."""
        from sidegan.kernels.bodies import Bodies

        return Bodies(chain_of(self.arm), shapes_alone(self.arm, self.pairs), self.hulls)

    def lower(self, q: Array, asked: Array, need: float = float("inf")) -> Array:
        """Lower bounds of distances [m], (M,), accurate to 1e-8 m; minus infinity where pieces touch.

        Args:
            q: positions [rad or m], (N, J).
            asked: row of ``q``, ascending, and pair of each query, (M, 2).
            need: distance [m] above which bounds need not be accurate.
        """
        from sidegan.kernels import bodies as kernel

        found = np.full(len(asked), -np.inf)
        if len(asked):
            room = kernel.place_for(self.bodies.shapes, self.arm.joints)
            kernel.distances(self.bodies, array(q), array(asked), need, found, room)
        return found

    def never_touching(self) -> Array:
        """Whether pairs provably never touch within the joint limits, (P,) bool.

        Branch and bound over boxes of joint positions, with the same motion bounds as the check of
        trajectories. Only for arms with pieces; pairs for which the proof takes too long may touch.
        """
        from sidegan.kernels import bodies as kernel

        arm, pairs = self.arm, self.pairs
        found = np.zeros(len(pairs), bool)
        if not len(pairs) or arm.capsules.pieces is None:
            return found
        reach = array(Reaches.of(arm, pairs, pairs[:0]).pieces)
        link = arm.capsules.link[pairs]
        work = np.empty((2, _DEPTH, arm.joints))
        room = kernel.place_for(self.bodies.shapes, arm.joints)
        for p, joints in enumerate(np.abs(link[:, 0] - link[:, 1]).tolist()):
            work[0, 0] = (arm.position_upper + arm.position_lower) / 2
            work[1, 0] = (arm.position_upper - arm.position_lower) / 2
            budget = _BUDGET[min(joints, len(_BUDGET)) - 1]
            found[p] = kernel.never_touch(self.bodies, reach, p, _GAP, work, budget, room)
        return found
