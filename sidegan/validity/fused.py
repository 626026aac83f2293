"""The search for the smallest margins by a compiled kernel: what it is given, and how threads share it."""

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import torch
from torch import Tensor

from sidegan.motion.compiled import cells as kernel_cells
from sidegan.motion.compiled import validity as kernel
from sidegan.motion.compiled.chain import array
from sidegan.motion.threads import each
from sidegan.motion.trajectory import Trajectory
from sidegan.validity.bounds import Slack, link_norms
from sidegan.validity.constraints import NAMES, Constraints
from sidegan.validity.search import ORDERS, Result, Search

_WORTH_A_THREAD = 2_000  # cells: two milliseconds of work

_models: WeakKeyDictionary[Constraints, kernel_cells.Model] = WeakKeyDictionary()


class FusedSearch(Search):
    """The same search with the same outcome, but for rounding, as ``Search``: on processors, much faster."""

    def __init__(self, constraints: Constraints, trajectory: Trajectory, c: Tensor) -> None:
        super().__init__(constraints, trajectory, c)
        if constraints not in _models:
            _models[constraints] = model_of(constraints)
        self.model = _models[constraints]._replace(home=np.array(trajectory.home))
        shape = len(c), len(NAMES)
        self.smallest = kernel.Smallest(np.full(shape, np.inf), np.zeros(shape, np.int64), np.zeros(shape))
        self.columns = {name: NAMES.index(name) for name in constraints.labels}

    def everything(self, cells: int) -> Tensor:
        """That all constraints are asked about in so many cells, (N, 7) bool."""
        return torch.from_numpy(kernel.everything(self.model, cells))

    def visit(self, cells: Tensor, asked: Tensor, count: int, last: bool) -> Tensor:
        """Update the margins from cells (N, 2) of (trajectory, index); see ``Search.visit``."""
        which, index = cells.T.contiguous()
        if count <= len(cells):
            used, rows = torch.arange(count), index
        else:
            used, rows = torch.unique(index, return_inverse=True)
        half = self.trajectory.period / count / 2
        centres = (used.to(self.c) + 0.5) * (2 * half)
        functions = [self.trajectory.basis(centres, order).flatten(1) for order in range(ORDERS)]
        tensors = self.c.flatten(2), self.jerk, torch.stack(self.drifts), torch.stack(functions, 1), centres
        c, jerk, drifts, basis, times = map(array, tensors)
        motions = kernel_cells.Motions(c, jerk, drifts, basis, times, half)
        wanted, undecided = asked.numpy(), np.empty(asked.shape, dtype=bool)
        cuts = _cuts(which)

        def work(k: int) -> None:
            part = slice(cuts[k], cuts[k + 1])
            mine = kernel.Cells(which.numpy()[part], rows.numpy()[part], last, wanted[part], undecided[part])
            kernel.visit(self.model, kernel_cells.work_space(self.model), motions, mine, self.smallest)

        each(work, len(cuts) - 1)
        self.valid = torch.from_numpy((self.smallest.margin[:, list(self.columns.values())] >= 0).all(1))
        return torch.from_numpy(undecided)

    def result(self) -> Result:
        """Whether each trajectory is valid; the smallest margins, their elements and times."""
        margins, elements, times = (
            {name: torch.from_numpy(table[:, k].copy()) for name, k in self.columns.items()}
            for table in self.smallest
        )
        return self.valid, margins, elements, times


def _cuts(which: Tensor) -> list[int]:
    """Where the work on cells is cut, for each of torch's threads; no trajectory (N,) is in two parts."""
    threads = max(1, min(torch.get_num_threads(), len(which) // _WORTH_A_THREAD))
    starts = which[[len(which) * k // threads for k in range(1, threads)]].contiguous()
    return [0, *torch.searchsorted(which, starts).tolist(), len(which)]


def model_of(constraints: Constraints) -> kernel_cells.Model:
    """The arm in its workspace as the kernel takes it, at home in zero."""
    arm, slack = constraints.arm, Slack(constraints)
    limit = arm.torque_limit
    tensors = {
        "parameters": arm.inertial_parameters.flatten(),
        "home": torch.zeros_like(limit),
        "lower": arm.position_lower,
        "upper": arm.position_upper,
        "speed": arm.velocity_limit,
        "torque": limit if constraints.torque else torch.full_like(limit, torch.inf),
        "higher": constraints.higher_rows,
        "pair_reach": slack.pair_reach,
        "piece_reach": slack.piece_reach,
        "region_reach": slack.region_reach,
        "region_most": largest_reach(slack.region_reach),
        **link_norms(arm),
    }
    arrays: dict[str, Any] = {name: array(x) for name, x in tensors.items()}
    shapes, links = constraints.shapes, _links_of(constraints, slack)
    return kernel_cells.Model(
        constraints.body.chain, shapes, constraints.pieces.hulls(), links=links, **arrays
    )


def _links_of(constraints: Constraints, slack: Slack) -> kernel_cells.Links:
    """The pairs of capsules, two links at a time."""
    capsules, pairs = constraints.arm.capsules, constraints.pairs
    frames, group = torch.unique((capsules.link[pairs] + 1).sort(1).values, dim=0, return_inverse=True)
    start = torch.searchsorted(group.sort().values, torch.arange(len(frames) + 1))
    most = torch.zeros(len(frames), constraints.arm.joints, dtype=torch.float64)
    for k in range(len(frames)):
        most[k] = slack.pair_reach[group == k].amax(0)
    return kernel_cells.Links(*map(array, (frames, most, torch.argsort(group, stable=True), start)))


def largest_reach(reach: Tensor) -> Tensor:
    """Largest reach of each joint, (1, J); zero where nothing is checked."""
    return torch.cat([reach, torch.zeros_like(reach.sum(0))[None]]).amax(0, keepdim=True)
