"""Batched gradient steps on trajectories that are good already, such as a generator's."""

from dataclasses import dataclass

import torch
from torch import Tensor

from sidegan.design.coordinates import Coordinates, objective
from sidegan.design.lbfgs import BatchedLbfgs
from sidegan.design.penalty import Penalty
from sidegan.design.problem import Problem
from sidegan.errors import ConfigError
from sidegan.validity import check

_WEIGHT = 300.0  # of the penalty
_FULL = 0.995  # share of a joint's limits that it may use
_AT_ONCE = 64  # trajectories: a batch that stays in the processor's cache


@dataclass(frozen=True)
class Polish:
    """L-BFGS from given trajectories; each is replaced only by a better valid one."""

    steps: int  # evaluations per trajectory
    # share of each limit that is kept free, and twice that share of 0.25 m as clearance
    reserve: float = 0.02

    def __post_init__(self) -> None:
        if self.steps < 1:
            raise ConfigError(f"polishing takes one step or more, got {self.steps}")

    def improve(self, problem: Problem, c: Tensor) -> Tensor:
        """Polished coefficients [rad/s], (B, J, H, 2), of coefficients (B, J, H, 2).

        A trajectory that is valid is never made invalid, and its condition number never larger.
        """
        problem.trajectory.check(c)
        c = c.double()
        polished = torch.cat([self._descend(problem, part) for part in c.split(_AT_ONCE)]) if len(c) else c
        before, after = (check(problem.constraints, problem.trajectory, x).valid for x in (c, polished))
        better = after & (~before | (problem.fitness(polished) < problem.fitness(c)))
        return torch.where(better[:, None, None, None], polished, c)

    def _descend(self, problem: Problem, c: Tensor) -> Tensor:
        coordinates = Coordinates.of(problem)
        function = objective(problem, Penalty.reserving(_WEIGHT, self.reserve), coordinates)
        search = BatchedLbfgs(function, coordinates.points(c))
        search.run(self.steps)
        c = coordinates.coefficients(search.x)
        # What little the search is over a limit, mostly between its time points, is taken back by scaling.
        return c / (problem.limit_use(c) / _FULL).clamp_min(1.0)[:, :, None, None]
