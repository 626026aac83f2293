"""The validity of whole trajectories: coarse cells first, finer ones only where a margin is small."""

from dataclasses import dataclass

import torch
from torch import Tensor

from sidegan.errors import ShapeError
from sidegan.trajectory import Trajectory
from sidegan.validity.bounds import Slack, cell_motion, jerk_bound
from sidegan.validity.constraints import Constraints

_COARSE = 0.1  # [s] longest cell of the first pass
_SPLIT = 4  # parts that a cell is cut into where it cannot be decided
_LEVELS = 6  # passes: the last one's cells are 0.1 s / 4⁵ = 0.1 ms long
_STATES_AT_ONCE = 8_192  # bounds the memory of a pass to about 100 MB for seven joints


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
    """Outcome of a check of B trajectories.

    Attributes:
        valid: whether every constraint provably holds over the whole period, (B,).
        margins: smallest margin found of each constraint, (B,) [rad, rad/s, N·m, m]; where a cell could
            not be decided at the finest step, the guaranteed margin, which is negative.
        elements: which joint, pair or region each smallest margin belongs to, (B,).
        times: when each smallest margin occurs [s], (B,).
        labels: the elements' names.
    """

    valid: Tensor
    margins: dict[str, Tensor]
    elements: dict[str, Tensor]
    times: dict[str, Tensor]
    labels: dict[str, tuple[str, ...]]

    def failures(self, index: int) -> list[Failure]:
        """What trajectory ``index`` violates, worst of each constraint; empty when it is valid."""
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


@torch.no_grad()
def check(constraints: Constraints, trajectory: Trajectory, c: Tensor) -> Validity:
    """Whether trajectories with coefficients [rad/s], (B, J, H, 2), are valid, and their margins.

    Samples the centres of cells of at most 0.1 s. A cell is settled when every margin at its centre
    is at least the largest possible change within it (``bounds``) or when one is negative; otherwise
    it is cut into four, down to 0.1 ms. What is undecided then counts as invalid. Works in float64
    whatever the coefficients' type: single precision leaves errors larger than the margins.

    Raises:
        ShapeError: when the coefficients have the wrong shape or are not finite, or the trajectory has
            another number of joints than the arm.
    """
    joints = constraints.arm.joints
    if trajectory.joints != joints:
        raise ShapeError(f"trajectories of {trajectory.joints} joints for an arm of {joints}")
    trajectory.check(c)
    search = _Search(constraints, trajectory, c.double())
    cells = -(-trajectory.period // _COARSE)
    count = int(cells)
    open_cells = torch.cartesian_prod(torch.arange(len(c)), torch.arange(count)).to(c.device).reshape(-1, 2)
    for level in range(_LEVELS):
        last = level == _LEVELS - 1
        parts = open_cells.split(_STATES_AT_ONCE)
        undecided = [search.visit(part, count, last) for part in parts]
        if last or not undecided:
            break
        open_cells = torch.cat(undecided)
        open_cells = open_cells[search.valid[open_cells[:, 0]]]
        if not len(open_cells):
            break
        finer = open_cells[:, 1:] * _SPLIT + torch.arange(_SPLIT, device=c.device)
        open_cells = torch.stack([open_cells[:, :1].expand_as(finer), finer], -1).reshape(-1, 2)
        count *= _SPLIT
    return search.result()


class _Search:
    """The state of a check: the smallest margins so far, updated cell by cell."""

    def __init__(self, constraints: Constraints, trajectory: Trajectory, c: Tensor) -> None:
        self.constraints, self.trajectory, self.c = constraints, trajectory, c
        self.slack = Slack(constraints)
        self.jerk = jerk_bound(trajectory, c, max(2, int(trajectory.period / _COARSE)))
        self.valid = torch.ones(len(c), dtype=torch.bool, device=c.device)
        self.margins = {name: c.new_full((len(c),), torch.inf) for name in constraints.labels}
        self.elements = {name: torch.zeros_like(self.valid, dtype=torch.long) for name in constraints.labels}
        self.times = {name: c.new_zeros(len(c)) for name in constraints.labels}

    def visit(self, cells: Tensor, count: int, last: bool) -> Tensor:
        """Update the margins from cells (N, 2) of (trajectory, index); those undecided come back."""
        which, index = cells.unbind(1)
        half = self.trajectory.period / count / 2
        used, rows = torch.unique(index, return_inverse=True)
        times = (used.to(self.c) + 0.5) * (2 * half)
        q, dq, ddq = (self._state(which, rows, times, order) for order in range(3))
        margins = self.constraints.margins(q, dq, ddq)
        slack = self.slack.of(cell_motion(dq, ddq, self.jerk[which], half), half)
        open_ = torch.zeros_like(which, dtype=torch.bool)
        for name, margin in margins.items():
            unsure = margin < slack[name]
            open_ |= unsure.any(1)
            if last:
                margin = torch.where(unsure & (margin >= 0), margin - slack[name], margin)
            self._record(name, margin, which, times[rows])
        return cells[open_]

    def _state(self, which: Tensor, rows: Tensor, times: Tensor, order: int) -> Tensor:
        if len(which) == len(self.c) * len(times):  # every trajectory on one grid: a single matrix product
            return self.trajectory.derivative(self.c, times, order).flatten(0, 1)
        basis = self.trajectory.basis(times, order)[rows].flatten(1)
        state = torch.einsum("nk,njk->nj", basis, self.c.flatten(2)[which])
        return state + self.c.new_tensor(self.trajectory.home) if order == 0 else state

    def _record(self, name: str, margin: Tensor, which: Tensor, times: Tensor) -> None:
        value, element = margin.min(1)
        best = self.margins[name].scatter_reduce(0, which, value, "amin")
        hit = torch.nonzero((value == best[which]) & (value < self.margins[name][which]))[:, 0]
        self.elements[name][which[hit]] = element[hit]
        self.times[name][which[hit]] = times[hit]
        self.margins[name] = best
        self.valid &= best >= 0

    def result(self) -> Validity:
        return Validity(self.valid, self.margins, self.elements, self.times, self.constraints.labels)
