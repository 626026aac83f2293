"""Sets of trajectories designed one after another, each given those before it."""

from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor

from sidegan.base.typed import Count, Share
from sidegan.design.coordinates import Coordinates
from sidegan.design.lbfgs import BatchedLbfgs, Function
from sidegan.design.objective import pull_back
from sidegan.design.penalty import Penalty
from sidegan.design.problem import Problem
from sidegan.errors import InfeasibleError
from sidegan.validity import check

_ROUGH, _STRICT = 100.0, 1000.0  # weights of the penalty
_GAIN = 20.0  # of the criterion beside them
_REACH = 0.8  # of the tightest limit that starts use
_FULL = 0.995  # share of the limits that are linear in the coefficients, to which a design is scaled back
_TRIES = 5


class SetAim(Protocol):
    """What a set is designed for, given the trajectories that it holds already."""

    def information(self, q: Tensor, dq: Tensor, ddq: Tensor, seconds: float) -> Tensor:
        """Information of B trajectories of so many seconds, each alone, at states (B, T, J): (B, P, P)."""

    def value(self, information: Tensor) -> Tensor:
        """Value after each of B trajectories beside those of the set, (B,); small is good."""

    def take(self, information: Tensor) -> None:
        """Count the trajectory of this information, (P, P), as one of the set."""


@dataclass(frozen=True)
class Search:
    """How much is spent on each trajectory of a set."""

    starts: Count  # at once
    rough: Count  # evaluations with half the time points
    strict: Count  # then, with all of them
    samples: Count  # time points per second
    reserve: Share  # of each limit, and twice that share of 0.25 m, while searching

    def one(self, problem: Problem, aim: SetAim, generator: torch.Generator) -> tuple[Tensor, float]:
        """The best valid trajectory beside those of the set, (J, H, 2), and its value.

        Raises:
            InfeasibleError: when no search ends within the constraints.
        """
        for _ in range(_TRIES):
            c = self._ends(problem, aim, generator)
            valid = check(problem.constraints, problem.trajectory, c).valid
            if valid.any():
                found = c[valid]
                with torch.no_grad():
                    values = aim.value(information(problem, aim, found, self._points(problem, 2)))
                best = int(values.argmin())
                return found[best], float(values[best])
        raise InfeasibleError(f"{_TRIES * self.starts} searches ended outside the constraints")

    def _ends(self, problem: Problem, aim: SetAim, generator: torch.Generator) -> Tensor:
        """Where the searches end, (starts, J, H, 2)."""
        coordinates = Coordinates.of(problem)
        rough = self._function(problem, aim, coordinates, _ROUGH, 0.5)
        search = BatchedLbfgs(rough, coordinates.start(problem, self.starts, generator, _REACH), 15)
        search.run(self.rough)
        search.restart(self._function(problem, aim, coordinates, _STRICT, 1.0))
        search.run(self.strict)
        c = coordinates.coefficients(search.x)
        return c / (problem.limit_use(c) / _FULL).clamp_min(1.0)[:, :, None, None]

    def _function(
        self, problem: Problem, aim: SetAim, coordinates: Coordinates, weight: float, share: float
    ) -> Function:
        penalty, count = Penalty.reserving(weight, self.reserve), self._points(problem, share)

        def function(x: Tensor) -> tuple[Tensor, Tensor]:
            c = coordinates.coefficients(x)
            value, slope = value_and_gradient(problem, aim, c, count)
            cost, push = pull_back(problem, c, None, penalty)
            return _GAIN * value + cost, coordinates.pull_back(_GAIN * slope + push)

        return function

    def _points(self, problem: Problem, share: float) -> int:
        family = problem.trajectory
        return max(2 * family.harmonics + 1, round(share * self.samples * family.period))


def information(problem: Problem, aim: SetAim, c: Tensor, count: int) -> Tensor:
    """Information of trajectories (B, J, H, 2), each alone, at so many time points: (B, P, P)."""
    family = problem.trajectory
    return aim.information(*family.roll_out(c, family.grid(count))[1:], family.period)


def value_and_gradient(problem: Problem, aim: SetAim, c: Tensor, count: int) -> tuple[Tensor, Tensor]:
    """Value of the aim, (B,), and its exact gradient, (B, J, H, 2), beside the trajectories of the set."""
    with torch.enable_grad():
        c = c.detach().requires_grad_(True)
        value = aim.value(information(problem, aim, c, count))
        (gradient,) = torch.autograd.grad(value.sum(), c)
    return value.detach(), gradient


def designed(problem: Problem, aim: SetAim, count: int, search: Search, generator: torch.Generator) -> Tensor:
    """A set of ``count`` trajectories, (count, J, H, 2), each designed given those before it.

    Raises:
        InfeasibleError: when no search ends within the constraints.
    """
    found = []
    with torch.no_grad():
        for _ in range(count):
            c, _ = search.one(problem, aim, generator)
            aim.take(information(problem, aim, c[None], search._points(problem, 4))[0])
            found.append(c)
    return torch.stack(found)
