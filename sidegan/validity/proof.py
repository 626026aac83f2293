"""Which capsules, or what is inside of them, provably cannot touch wherever the joints are."""

import numpy as np
import torch
from torch import Tensor

from sidegan.motion.arrays import array, chain_of
from sidegan.robot import Arm
from sidegan.validity.bounds import piece_reach
from sidegan.validity.capsules import shapes_alone
from sidegan.validity.pieces import PieceDistances

_BUDGET = (100_000, 20_000, 2_000)  # boxes for a pair with one, two, and more joints between them
_DEPTH = 512  # boxes that wait at most
_GAP = 1e-6  # [m] that must be left, far above what rounding makes


def never_touching(arm: Arm, pairs: Tensor) -> Tensor:
    """Which pairs of capsules, of some (P, 2), provably never touch within the joints' limits, (P,) bool.

    Branch and bound over boxes of joint positions, with the bounds on motion that the check of trajectories
    uses. Only for arms with something inside of their capsules; a pair for which the proof takes too long
    counts as one that may touch.
    """
    found = torch.zeros(len(pairs), dtype=torch.bool)
    inside = PieceDistances(arm, pairs)
    if not len(pairs) or arm.capsules.pieces is None:
        return found
    from sidegan.kernels import bodies as kernel

    bodies = kernel.Bodies(chain_of(arm), shapes_alone(arm, pairs), inside.hulls())
    link = arm.capsules.link[pairs]
    outer = torch.where(link[:, 0] > link[:, 1], pairs[:, 0], pairs[:, 1])
    reach = array(piece_reach(arm)[outer])
    middle, half = arm.position_upper + arm.position_lower, arm.position_upper - arm.position_lower
    work, room = np.empty((2, _DEPTH, arm.joints)), kernel.place_for(bodies.shapes, arm.joints)
    for p, joints in enumerate((link[:, 0] - link[:, 1]).abs().tolist()):
        work[0, 0], work[1, 0] = middle.numpy() / 2, half.numpy() / 2
        budget = _BUDGET[min(joints, len(_BUDGET)) - 1]
        found[p] = kernel.never_touch(bodies, reach, p, _GAP, work, budget, room)
    return found
