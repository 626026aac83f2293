"""Checks of whole trajectories, and of straight paths in joint space."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array, split
from sidegan.errors import InfeasibleError, ShapeError
from sidegan.motion.trajectory import Trajectory
from sidegan.validity.capsules import reaches
from sidegan.validity.constraints import CONSTRAINTS, DISTANCES, Constraints

_CELLS_AT_ONCE = 1_000_000  # in the first pass: 30 MB of indices
_PARTS, _HALVINGS = 16, 12  # of a straight path: initially, and then down to 1.5e-5 of it


@dataclass(frozen=True)
class Failure:
    """A violated constraint of one trajectory: joint, pair or region, time [s] and margin."""

    constraint: str
    where: str
    time: float
    margin: float

    def __str__(self) -> str:
        return f"{self.constraint} of {self.where} at {self.time:.3f} s: margin {self.margin:.4g}"


@dataclass(frozen=True)
class Validity:
    """Outcome of a check of B trajectories."""

    valid: Array  # whether every constraint provably holds over the whole period, (B,)
    # smallest margin of each constraint in its unit, (B,); the guaranteed, negative margin if a cell is still
    # undecided at the finest step
    margins: dict[str, Array]
    elements: dict[str, Array]  # joint, pair or region of each smallest margin, (B,)
    times: dict[str, Array]  # of each smallest margin [s], (B,)
    labels: dict[str, tuple[str, ...]]  # names of the elements

    def faults(self) -> Counter[str]:
        """Number of trajectories by violation, for people."""
        invalid = np.flatnonzero(~self.valid).tolist()
        return Counter(f"{x.constraint} of {x.where}" for k in invalid for x in self.failures(k))

    def failures(self, index: int) -> list[Failure]:
        """Worst violation of each constraint by trajectory ``index``; empty if it is valid."""
        found = []
        for name, margin in self.margins.items():
            if not margin[index] >= 0:
                where = self.labels[name][int(self.elements[name][index])]
                found.append(Failure(name, where, float(self.times[name][index]), float(margin[index])))
        return found


def summarise_faults(faults: Mapping[str, int]) -> str:
    """The three most common faults in words."""
    common = Counter(faults).most_common(3)
    return "; ".join(f"{count} {'violates' if count == 1 else 'violate'} {fault}" for fault, count in common)


def check(constraints: Constraints, trajectory: Trajectory, c: Array) -> Validity:
    """Validity and margins of trajectories with coefficients [rad/s], (B, J, H, 2).

    Samples the centres of cells of at most 0.1 s. A cell is decided if every margin at its centre is at
    least the largest possible change within the cell, or if a margin is negative. Otherwise
    it is cut into three, down to 0.14 ms; cells still undecided count as invalid. All is in float64, since
    errors in single precision exceed the margins.

    Raises:
        ShapeError: when the coefficients have the wrong shape or are not finite, or the trajectory's number
            of joints is not the arm's.
    """
    from sidegan.validity.search import MarginSearch, coarse_cells  # imports compiled code

    joints = constraints.arm.joints
    if trajectory.joints != joints:
        raise ShapeError(f"trajectories have {trajectory.joints} joints, the arm has {joints}")
    trajectory.check(c)
    found = []
    for part in split(c, max(1, _CELLS_AT_ONCE // coarse_cells(trajectory))):
        search = MarginSearch(constraints, trajectory, part)
        search.run()
        found.append(search.smallest)
    smallest = [*map(np.concatenate, zip(*found))]
    column = {name: CONSTRAINTS.index(name) for name in constraints.labels}
    margins, elements, times = ({name: x[:, k] for name, k in column.items()} for x in smallest)
    return Validity(np.all(smallest[0] >= 0, 1), margins, elements, times, constraints.labels)


def require_straight(constraints: Constraints, start: Sequence[float], end: Sequence[float]) -> None:
    """Refuse a straight path in joint space [rad or m] that is not free, or where the arm cannot hold itself.

    Distances and the joints' ranges are covered at every point of the path: between samples, a distance
    changes at most by the joints' motion times their reach. Torques are those of the samples.

    Raises:
        ShapeError: when the ends are not one finite number per joint.
        InfeasibleError: when the path is not free; names the violated constraint and where on the path.
    """
    joints = constraints.arm.joints
    if {len(start), len(end)} != {joints} or not all(map(math.isfinite, (*start, *end))):
        raise ShapeError(f"ends of a path must be {joints} finite joint positions each")
    ends = np.array([start, end], float)
    pairs, pieces, regions = reaches(constraints.arm, constraints.pairs, constraints.guarded)
    rates = np.maximum(pairs, pieces), regions
    change = np.abs(ends[1] - ends[0])
    slack = {name: x @ change for name, x in zip(DISTANCES, rates) if name in constraints.labels}
    share, half = (np.arange(_PARTS) + 0.5) / _PARTS, 0.5 / _PARTS
    _margins_along(constraints, ends, np.array([0.0, 1.0]))  # the ends are no cell's centre
    for _ in range(_HALVINGS):
        margins = _margins_along(constraints, ends, share)
        unsure = np.zeros(len(share), bool)
        for name, most in slack.items():
            unsure |= (margins[name] < half * most).any(1)
        if not unsure.any():
            return
        half /= 2
        share = np.concatenate([share[unsure] - half, share[unsure] + half])
    raise InfeasibleError(f"the straight path is nearly in contact {float(share[0]):.1%} along it")


def _margins_along(constraints: Constraints, ends: Array, share: Array) -> dict[str, Array]:
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
