"""The validity of whole trajectories, and what they violate."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array, split
from sidegan.errors import ShapeError
from sidegan.motion.trajectory import Trajectory
from sidegan.validity.bounds import coarse_cells
from sidegan.validity.constraints import NAMES, Constraints

_CELLS_AT_ONCE = 1_000_000  # of the first pass: 30 MB of indices


@dataclass(frozen=True)
class Failure:
    """A violated constraint of one trajectory: where (joint, pair or region), when [s], by how much."""

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
    # smallest margin of each constraint, (B,) [rad, rad/s, N·m, m]; where a cell could not be decided at the
    # finest step, the guaranteed margin, which is negative
    margins: dict[str, Array]
    elements: dict[str, Array]  # which joint, pair or region each smallest margin belongs to, (B,)
    times: dict[str, Array]  # when each smallest margin occurs [s], (B,)
    labels: dict[str, tuple[str, ...]]  # the elements' names

    def faults(self) -> Counter[str]:
        """How many trajectories violate what, for people."""
        invalid = np.flatnonzero(~self.valid).tolist()
        return Counter(f"{one.constraint} of {one.where}" for k in invalid for one in self.failures(k))

    def failures(self, index: int) -> list[Failure]:
        """Violations of trajectory ``index``, worst of each constraint; empty when it is valid."""
        return [
            Failure(
                name,
                self.labels[name][int(self.elements[name][index])],
                float(self.times[name][index]),
                float(m),
            )
            for name, margin in self.margins.items()
            if not (m := margin[index]) >= 0
        ]


def summarise_faults(faults: Mapping[str, int]) -> str:
    """The three most common faults in words."""
    return "; ".join(f"{count} violate {fault}" for fault, count in Counter(faults).most_common(3))


def check(constraints: Constraints, trajectory: Trajectory, c: Array) -> Validity:
    """Whether trajectories with coefficients [rad/s], (B, J, H, 2), are valid, and their margins.

    Samples the centres of cells of at most 0.1 s. A cell is settled when every margin at its centre
    is at least the largest possible change within it (``bounds``) or when one is negative; otherwise
    it is cut into three, down to 0.14 ms. What is undecided then counts as invalid. Works in float64:
    single precision leaves errors larger than the margins.

    Raises:
        ShapeError: when the coefficients have the wrong shape or are not finite, or the trajectory has
            another number of joints than the arm.
    """
    from sidegan.validity.search import Search

    joints = constraints.arm.joints
    if trajectory.joints != joints:
        raise ShapeError(f"trajectories have {trajectory.joints} joints, the arm has {joints}")
    trajectory.check(c)
    found = []
    for part in split(c, max(1, _CELLS_AT_ONCE // coarse_cells(trajectory))):
        search = Search(constraints, trajectory, part)
        search.run()
        found.append(search.smallest)
    whole = [np.concatenate(tables) for tables in zip(*found)]
    margins, elements, times = (
        {name: table[:, NAMES.index(name)] for name in constraints.labels} for table in whole
    )
    return Validity(np.all(whole[0] >= 0, 1), margins, elements, times, constraints.labels)
