"""The search for the smallest margins: coarse cells first, finer ones only where a margin is small."""

from functools import cached_property

import torch
from torch import Tensor

from sidegan.motion.compiled.formulas import drift
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import HIGHER
from sidegan.validity.bounds import Slack, cell_motion, derivative_bound, jerk_bound
from sidegan.validity.constraints import Constraints
from sidegan.validity.moving import Moving

Result = tuple[Tensor, dict[str, Tensor], dict[str, Tensor], dict[str, Tensor]]

COARSE = 0.1  # [s] longest cell of the first pass
SPLIT = 3  # parts that a cell is cut into where it cannot be decided
ORDERS = 5  # derivatives of the motion, from none on, that kernels take
LEVELS = 7  # passes: the last one's cells are 0.1 s / 3⁶ = 0.14 ms long
_TOGETHER = (("position", "velocity"), tuple(HIGHER))  # constraints that are asked about together
_STATES_AT_ONCE = 8_192  # bounds the memory of a pass to about 100 MB for seven joints


def coarse_cells(trajectory: Trajectory) -> int:
    """Number of cells of the first pass over one trajectory."""
    return int(-(-trajectory.period // COARSE))


class Search:
    """The state of a check of coefficients (B, J, H, 2): the smallest margins so far."""

    def __init__(self, constraints: Constraints, trajectory: Trajectory, c: Tensor) -> None:
        self.constraints, self.trajectory, self.c = constraints, trajectory, c
        self.jerk = jerk_bound(trajectory, c, max(2, int(trajectory.period / COARSE)))
        # Bounds of the fourth and the fifth derivative: an acceleration or a jerk drifts by the next one at
        # first, and that by the one after it.
        self.drifts = [derivative_bound(trajectory, c, order) for order in (4, 5)]
        self.orders = max([3 + constraints.torque, *(HIGHER[name] + 2 for name in constraints.higher)])
        self.valid = torch.ones(len(c), dtype=torch.bool, device=c.device)
        self.margins = {name: c.new_full((len(c),), torch.inf) for name in constraints.labels}
        self.elements = {name: torch.zeros_like(self.valid, dtype=torch.long) for name in constraints.labels}
        self.times = {name: c.new_zeros(len(c)) for name in constraints.labels}

    @cached_property
    def slack(self) -> Slack:
        """How much the margins change in a cell."""
        return Slack(self.constraints)

    def run(self) -> None:
        """Visit cells until every trajectory is settled, or the finest level is done.

        A part of a cell is asked only what its whole could not decide.
        """
        count, device = coarse_cells(self.trajectory), self.c.device
        grid = torch.arange(len(self.c), device=device), torch.arange(count, device=device)
        cells = torch.cartesian_prod(*grid).reshape(-1, 2)
        asked = self.everything(len(cells))
        for level in range(LEVELS):
            undecided = self.visit(cells, asked, count, level == LEVELS - 1)
            open_ = undecided.any(1) & self.valid[cells[:, 0]]
            cells, asked = cells[open_], undecided[open_]
            if not len(cells):
                break
            finer = cells[:, 1:] * SPLIT + torch.arange(SPLIT, device=device)
            cells = torch.stack([cells[:, :1].expand_as(finer), finer], -1).reshape(-1, 2)
            asked = asked.repeat_interleave(SPLIT, 0)
            count *= SPLIT

    def everything(self, cells: int) -> Tensor:
        """That all constraints are asked about in so many cells, (N, G) bool."""
        return torch.ones(cells, len(self.margins), dtype=torch.bool, device=self.c.device)

    def visit(self, cells: Tensor, asked: Tensor, count: int, last: bool) -> Tensor:
        """Update the margins from cells (N, 2) of (trajectory, index).

        Asked is about which constraints, (N, G) bool; those of them come back that leave a cell undecided.
        """
        parts = zip(cells.split(_STATES_AT_ONCE), asked.split(_STATES_AT_ONCE))
        return torch.cat([asked[:0], *(self._visit(*part, count, last) for part in parts)])

    def _visit(self, cells: Tensor, asked: Tensor, count: int, last: bool) -> Tensor:
        which, index = cells.unbind(1)
        half = self.trajectory.period / count / 2
        used, rows = torch.unique(index, return_inverse=True)
        times = (used.to(self.c) + 0.5) * (2 * half)
        states = [self._state(which, rows, times, order) for order in range(self.orders)]
        margins = self.constraints.capsule_margins(*states[: self.constraints.orders])
        motion = cell_motion(states[1], states[2], self.jerk[which], self.drifts[0][which], half)
        rate = self.constraints.body.torque_rate(*states[:4]) if "torque" in margins else None
        slack = self.slack.of(motion, half, rate)
        for name in self.constraints.higher:
            order = HIGHER[name]
            slack[name] = drift(states[order + 1], self.drifts[order - 2][which], half)
        names = list(margins)
        moving = Moving(self.constraints.pieces, self.slack, states[0], states[1], motion, half)
        if "collision" in margins:
            self._look_closer(moving, asked[:, names.index("collision")], margins, slack)
        if "keep_out" in margins:
            margin, most = margins["keep_out"], slack["keep_out"]
            near = torch.nonzero((margin > 0) & (margin < most) & asked[:, names.index("keep_out"), None])
            where = tuple(near.T)
            least = moving.regions(self.constraints.kept_out, self.constraints.guarded, near)
            most[where] = torch.minimum(most[where], margin[where] - least)
        undecided = torch.zeros_like(asked)
        for k, (name, margin) in enumerate(margins.items()):
            here = asked[:, k, None]
            unsure = ~(margin >= slack[name]) & here
            undecided[:, k] = unsure.any(1)
            if last:
                margin = torch.where(unsure & (margin >= 0), margin - slack[name], margin)
            self._record(name, torch.where(here, margin, torch.inf), which, times[rows])
        for group in _TOGETHER:
            columns = [names.index(name) for name in group if name in names]
            undecided[:, columns] = undecided[:, columns].any(1, keepdim=True)
        return undecided

    def _look_closer(
        self, pairs: Moving, here: Tensor, margins: dict[str, Tensor], slack: dict[str, Tensor]
    ) -> None:
        """Let how pairs move decide where reach does not, and what is inside of them where it says more."""
        margin, most = margins["collision"], slack["collision"]
        open_ = ~(margin >= most) & here[:, None]
        asked = torch.nonzero(open_ & (margin > 0))
        where = tuple(asked.T)
        most = most.index_put(where, torch.minimum(most[where], margin[where] - pairs.capsules(asked)))
        inside = self.constraints.pieces
        asked = torch.nonzero(open_ & ~(margin >= most) & inside.finer)
        where = tuple(asked.T)
        inner = inside.lower(pairs.q, asked)
        better = inner > margin[where]
        asked, inner, where = asked[better], inner[better], tuple(asked[better].T)
        reach = (pairs.motion.position_change[where[0]] * self.slack.piece_reach[where[1]].to(inner)).sum(1)
        least = torch.maximum(margin[where] - most[where], inner - reach)
        if len(asked):
            least = torch.maximum(least, pairs.inside(asked))
        margins["collision"] = margin.index_put(where, inner)
        slack["collision"] = most.index_put(where, inner - least)

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
