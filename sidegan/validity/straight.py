"""Check of straight paths in joint space."""

import math
from collections.abc import Sequence

import numpy as np

from sidegan.base.arrays import Array
from sidegan.errors import InfeasibleError, ShapeError
from sidegan.validity.bounds import Reaches
from sidegan.validity.constraints import DISTANCES, Constraints

_CELLS = 16  # of the path, initially
_LEVELS = 12  # of halving, down to 1.5e-5 of the path


def require_straight(constraints: Constraints, start: Sequence[float], end: Sequence[float]) -> None:
    """Refuse a straight path in joint space [rad or m] that collides or leaves the joints' ranges.

    Every point of the path is covered: between samples, a distance changes at most by the joints' motion
    times their reach.

    Raises:
        ShapeError: when the ends are not one finite number per joint.
        InfeasibleError: when the path is not free; names the violated constraint and where on the path.
    """
    joints = constraints.arm.joints
    if {len(start), len(end)} != {joints} or not all(map(math.isfinite, (*start, *end))):
        raise ShapeError(f"ends of a path must be {joints} finite joint positions each")
    ends = np.array([start, end], float)
    reaches = Reaches.of(constraints.arm, constraints.pairs, constraints.guarded)
    rates = np.maximum(reaches.pairs, reaches.pieces), reaches.regions
    change = np.abs(ends[1] - ends[0])
    slack = {name: x @ change for name, x in zip(DISTANCES, rates) if name in constraints.labels}
    share, half = (np.arange(_CELLS) + 0.5) / _CELLS, 0.5 / _CELLS
    _margins(constraints, ends, np.array([0.0, 1.0]))  # the ends are no cell's centre
    for _ in range(_LEVELS):
        margins = _margins(constraints, ends, share)
        unsure = np.zeros(len(share), bool)
        for name, most in slack.items():
            unsure |= (margins[name] < half * most).any(1)
        if not unsure.any():
            return
        half /= 2
        share = np.concatenate([share[unsure] - half, share[unsure] + half])
    raise InfeasibleError(f"the straight path is nearly in contact {float(share[0]):.1%} along it")


def _margins(constraints: Constraints, ends: Array, share: Array) -> dict[str, Array]:
    """Margins at shares (N,) of the path between ends (2, J); raises if any is negative."""
    margins = constraints.at_rest(ends[0] + share[:, None] * (ends[1] - ends[0]))
    for name, margin in margins.items():
        bad = np.argwhere(margin < 0)
        if len(bad):
            row, element = bad[share[bad[:, 0]].argmin()].tolist()
            raise InfeasibleError(
                f"the straight path is not free: {name} of {constraints.labels[name][element]} has margin "
                f"{float(margin[row, element]):.3g}, {float(share[row]):.0%} along it"
            )
    return margins
