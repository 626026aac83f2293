"""A distance that is kept: shapes and regions that are thicker by it, each by half."""

from collections.abc import Sequence
from dataclasses import replace
from weakref import WeakKeyDictionary

from sidegan.robot import Arm
from sidegan.validity.regions import Region

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


def grown(regions: Sequence[Region], clearance: float) -> tuple[Region, ...]:
    """Regions whose surfaces lie half a clearance [m] further out; at the edges of boxes a little more."""
    return tuple(region.grown(clearance / 2) if clearance else region for region in regions)
