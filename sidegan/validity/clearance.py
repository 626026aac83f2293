"""A distance that is kept: shapes that are thicker by half of it each."""

import math
from collections.abc import Sequence
from dataclasses import replace
from weakref import WeakKeyDictionary

from sidegan.base.names import listed
from sidegan.errors import InfeasibleError
from sidegan.robot import Arm

_STEPS = 1e4  # per metre: clearances that are offered are so many whole ones
_SPARE = 0.1  # share of the distance that is there, that these stay below
_SHOWN = 4  # names that are told

_made: WeakKeyDictionary[Arm, dict[float, Arm]] = WeakKeyDictionary()


def thicker(arm: Arm, clearance: float) -> Arm:
    """The arm with shapes whose surfaces lie half a clearance [m] further out; the arm itself for none."""
    if not clearance:
        return arm
    known = _made.setdefault(arm, {})
    if clearance not in known:
        half, capsules = clearance / 2, arm.capsules
        pieces = capsules.pieces
        if pieces is not None:
            pieces = replace(pieces, radius=pieces.radius + half, core=pieces.core + half)
        thick = replace(capsules, radius=capsules.radius + half, pieces=pieces)
        known[clearance] = replace(arm, capsules=thick)
    return known[clearance]


def too_large(clearance: float, near: Sequence[str], left: float) -> InfeasibleError:
    """Refusal of a clearance that some never have.

    Args:
        clearance: that one [m].
        near: what is always nearer.
        left: what is left of their distance beyond the clearance at best, below zero [m].
    """
    room = (clearance + left) * (1 - _SPARE) if math.isfinite(left) else 0.0
    most = max(math.floor(room * _STEPS), 0) / _STEPS
    return InfeasibleError(
        f"workspace.clearance={clearance:g} cannot be kept, set a smaller one: always nearer are "
        f"{listed(list(near), _SHOWN)}; 'workspace.clearance={most:g}' leaves room for these"
    )
