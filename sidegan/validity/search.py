"""The search for the smallest margins: coarse cells first, finer ones only where a margin is small."""

from functools import cached_property

import torch
from torch import Tensor

from sidegan.motion.compiled.formulas import drift
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import HIGHER
from sidegan.validity.bounds import CellMotion, Slack, cell_motion, derivative_bound, jerk_bound
from sidegan.validity.constraints import Constraints

Result = tuple[Tensor, dict[str, Tensor], dict[str, Tensor], dict[str, Tensor]]

COARSE = 0.1  # [s] longest cell of the first pass
SPLIT = 4  # parts that a cell is cut into where it cannot be decided
LEVELS = 6  # passes: the last one's cells are 0.1 s / 4⁵ = 0.1 ms long
_STATES_AT_ONCE = 8_192  # bounds the memory of a pass to about 100 MB for seven joints


def coarse_cells(trajectory: Trajectory) -> int:
    """Number of cells of the first pass over one trajectory."""
    return int(-(-trajectory.period // COARSE))


class Search:
    """The state of a check of coefficients (B, J, H, 2): the smallest margins so far."""

    def __init__(self, constraints: Constraints, trajectory: Trajectory, c: Tensor) -> None:
        self.constraints, self.trajectory, self.c = constraints, trajectory, c
        self.jerk = jerk_bound(trajectory, c, max(2, int(trajectory.period / COARSE)))
        # Of the derivative after the next one, by what is limited: a margin drifts by the next one at first.
        self.bounds = {name: derivative_bound(trajectory, c, HIGHER[name] + 2) for name in constraints.higher}
        self.orders = max([3, *(HIGHER[name] + 2 for name in constraints.higher)])
        self.valid = torch.ones(len(c), dtype=torch.bool, device=c.device)
        self.margins = {name: c.new_full((len(c),), torch.inf) for name in constraints.labels}
        self.elements = {name: torch.zeros_like(self.valid, dtype=torch.long) for name in constraints.labels}
        self.times = {name: c.new_zeros(len(c)) for name in constraints.labels}

    @cached_property
    def slack(self) -> Slack:
        """How much the margins change in a cell."""
        return Slack(self.constraints)

    def run(self) -> None:
        """Visit cells until every trajectory is settled, or the finest level is done."""
        count, device = coarse_cells(self.trajectory), self.c.device
        grid = torch.arange(len(self.c), device=device), torch.arange(count, device=device)
        cells = torch.cartesian_prod(*grid).reshape(-1, 2)
        for level in range(LEVELS):
            cells = self.visit(cells, count, level == LEVELS - 1)
            cells = cells[self.valid[cells[:, 0]]]
            if not len(cells):
                break
            finer = cells[:, 1:] * SPLIT + torch.arange(SPLIT, device=device)
            cells = torch.stack([cells[:, :1].expand_as(finer), finer], -1).reshape(-1, 2)
            count *= SPLIT

    def visit(self, cells: Tensor, count: int, last: bool) -> Tensor:
        """Update the margins from cells (N, 2) of (trajectory, index); those undecided come back."""
        parts = cells.split(_STATES_AT_ONCE)
        return torch.cat([cells[:0], *(self._visit(part, count, last) for part in parts)])

    def _visit(self, cells: Tensor, count: int, last: bool) -> Tensor:
        which, index = cells.unbind(1)
        half = self.trajectory.period / count / 2
        used, rows = torch.unique(index, return_inverse=True)
        times = (used.to(self.c) + 0.5) * (2 * half)
        states = [self._state(which, rows, times, order) for order in range(self.orders)]
        margins = self.constraints.capsule_margins(*states[: self.constraints.orders])
        motion = cell_motion(states[1], states[2], self.jerk[which], half)
        slack = self.slack.of(motion, half)
        for name, bound in self.bounds.items():
            slack[name] = drift(states[HIGHER[name] + 1], bound[which], half)
        if self.constraints.pieces.finer.any():
            self._look_inside(states[0], margins, slack, motion)
        open_ = torch.zeros_like(which, dtype=torch.bool)
        for name, margin in margins.items():
            unsure = ~(margin >= slack[name])
            open_ |= unsure.any(1)
            if last:
                margin = torch.where(unsure & (margin >= 0), margin - slack[name], margin)
            self._record(name, margin, which, times[rows])
        return cells[open_]

    def _look_inside(
        self, q: Tensor, margins: dict[str, Tensor], slack: dict[str, Tensor], motion: CellMotion
    ) -> None:
        """Let what is inside of capsules decide where they do not, if it guarantees more."""
        margin, most = margins["collision"], slack["collision"]
        pieces = self.constraints.pieces
        asked = torch.nonzero(~(margin >= most) & pieces.finer)
        outside, inside = self.slack.here(q, asked, motion)
        slack["collision"] = most = most.index_put(tuple(asked.T), outside)
        still = margin[tuple(asked.T)] < outside
        asked, inside = asked[still], inside[still]
        where = tuple(asked.T)
        inner = pieces.lower(q, asked)
        guaranteed = torch.maximum(inner - inside, margin[where] - most[where])
        better = inner > margin[where]
        where = tuple(asked[better].T)
        margins["collision"] = margin.index_put(where, inner[better])
        slack["collision"] = most.index_put(where, (inner - guaranteed)[better])

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

    def result(self) -> Result:
        """Whether each trajectory is valid; the smallest margins, their elements and times."""
        return self.valid, self.margins, self.elements, self.times
