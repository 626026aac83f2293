"""Sets designed one trajectory after another, each given those before it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from sidegan.base.typed import Count, Share
from sidegan.design.coordinates import Coordinates
from sidegan.design.lbfgs import BatchedLbfgs, Function
from sidegan.design.objective import pull_back
from sidegan.design.penalty import Penalty
from sidegan.design.prediction import Prediction, Told, beside
from sidegan.design.problem import Problem
from sidegan.errors import InfeasibleError
from sidegan.validity import check

_ROUGH, _STRICT = 100.0, 1000.0  # weights of the penalty
_GAIN = 20.0  # of the criterion beside them
_REACH = 0.8  # of the tightest limit that starts use
_FULL = 0.995  # share of the limits that are linear in the coefficients, to which a design is scaled back
_TRIES = 5

# Where so many searches for an aim begin, (n, J, H, 2) [rad/s].
Begin = Callable[[Problem, Prediction, int, torch.Generator], Tensor]


@dataclass(frozen=True)
class Search:
    """How much is spent on each trajectory of a set."""

    starts: Count  # at once
    rough: Count  # evaluations with half the time points
    strict: Count  # then, with all of them
    samples: Count  # time points per second
    reserve: Share  # of each limit, and twice that share of 0.25 m, while searching

    def one(
        self, problem: Problem, aim: Prediction, generator: torch.Generator, begin: Begin | None = None
    ) -> tuple[Tensor, float]:
        """The best valid trajectory beside those that the aim knows, (J, H, 2), and its value.

        Raises:
            InfeasibleError: when no search ends within the constraints.
        """
        return self.each(problem, [aim], [generator], begin)[0]

    def each(
        self,
        problem: Problem,
        aims: Sequence[Prediction],
        generators: Sequence[torch.Generator],
        begin: Begin | None = None,
    ) -> list[tuple[Tensor, float]]:
        """The same for each of several aims that differ in what they know alone, all searches at once.

        Searches begin anywhere, or where they are told to; then those places count as found, too.

        Raises:
            InfeasibleError: when no search of one of them ends within the constraints.
        """
        found: dict[int, tuple[Tensor, float]] = {}
        for _ in range(_TRIES):
            left = [k for k in range(len(aims)) if k not in found]
            c = self._ends(problem, [aims[k] for k in left], [generators[k] for k in left], begin)
            valid = check(problem.constraints, problem.trajectory, c.flatten(0, 1)).valid
            for k, own, good in zip(left, c, valid.view(len(left), -1)):
                if good.any():
                    found[k] = self._best(problem, aims[k], own[good])
            if len(found) == len(aims):
                return [found[k] for k in range(len(aims))]
        raise InfeasibleError(f"{_TRIES * self.starts} searches ended outside the constraints")

    def _best(self, problem: Problem, aim: Prediction, c: Tensor) -> tuple[Tensor, float]:
        with torch.no_grad():
            values = aim.value(told(problem, aim, c, self._points(problem, 2)))
        best = int(values.argmin())
        return c[best], float(values[best])

    def _ends(
        self,
        problem: Problem,
        aims: Sequence[Prediction],
        generators: Sequence[torch.Generator],
        begin: Begin | None,
    ) -> Tensor:
        """Where the searches of the aims end, and where they were told to begin, (aims, n, J, H, 2)."""
        coordinates, each = Coordinates.of(problem), (len(aims), self.starts)
        if begin is None:
            x = torch.cat([coordinates.start(problem, self.starts, one, _REACH) for one in generators])
            return self._descend(problem, aims, coordinates, x).unflatten(0, each)
        first = torch.stack([begin(problem, one, self.starts, own) for one, own in zip(aims, generators)])
        ends = self._descend(problem, aims, coordinates, coordinates.points(first.flatten(0, 1)))
        return torch.cat([ends.unflatten(0, each), first], 1)

    def _descend(
        self, problem: Problem, aims: Sequence[Prediction], coordinates: Coordinates, x: Tensor
    ) -> Tensor:
        """Where searches from points of all aims end, (aims · starts, J, H, 2)."""
        aim = beside(aims, self.starts)
        phases = ((_ROUGH, 0.5, self.rough), (_STRICT, 1.0, self.strict))
        search: BatchedLbfgs | None = None
        for weight, share, steps in phases:
            function = self._function(problem, aim, coordinates, weight, share)
            if search is None:
                search = BatchedLbfgs(function, x, 15)
            else:
                search.restart(function)
            search.run(steps)
        assert search is not None
        c = coordinates.coefficients(search.x)
        return c / (problem.limit_use(c) / _FULL).clamp_min(1.0)[:, :, None, None]

    def _function(
        self, problem: Problem, aim: Prediction, coordinates: Coordinates, weight: float, share: float
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


def told(problem: Problem, aim: Prediction, c: Tensor, count: int) -> Told:
    """What trajectories (B, J, H, 2) tell, at so many time points."""
    family = problem.trajectory
    return aim.told(*family.roll_out(c, family.grid(count))[1:], family.period)


def value_and_gradient(problem: Problem, aim: Prediction, c: Tensor, count: int) -> tuple[Tensor, Tensor]:
    """The aim's value, (B,), and its exact gradient, (B, J, H, 2), of trajectories beside those it knows."""
    with torch.enable_grad():
        c = c.detach().requires_grad_(True)
        value = aim.value(told(problem, aim, c, count))
        (gradient,) = torch.autograd.grad(value.sum(), c)
    return value.detach(), gradient


def designed(
    problems: Sequence[Problem],
    aim: Prediction,
    count: int,
    search: Search,
    generator: torch.Generator,
    report: Callable[[int, int], None] = lambda done, total: None,
    begin: Begin | None = None,
) -> tuple[Problem, Tensor]:
    """A set of ``count`` trajectories, (count, J, H, 2), each designed given those before it.

    Of several problems, such as the same one at several periods, the one is taken whose first trajectory
    lowers the aim most in a second; its family is that of the whole set.

    Raises:
        InfeasibleError: when no search ends within the constraints.
    """
    with torch.no_grad():
        problem, first = problems[0], None
        if len(problems) > 1:
            now = _now(aim)
            firsts = [(one, *search.one(one, aim, generator, begin)) for one in problems]
            problem, first, _ = min(firsts, key=lambda x: (x[2] - now) / x[0].trajectory.period)
            _take(problem, aim, search, first)
        rest = count if first is None else count - 1
        (c,) = together(problem, [aim], rest, search, [generator], report, begin)
        return problem, c if first is None else torch.cat([first[None], c])


def together(
    problem: Problem,
    aims: Sequence[Prediction],
    count: int,
    search: Search,
    generators: Sequence[torch.Generator],
    report: Callable[[int, int], None] = lambda done, total: None,
    begin: Begin | None = None,
) -> list[Tensor]:
    """Sets of ``count`` trajectories, (count, J, H, 2), for aims that differ in what they know alone.

    Each is designed given those before it in its set. All at once take little longer than one.

    Raises:
        InfeasibleError: when no search ends within the constraints.
    """
    chosen: list[list[Tensor]] = [[] for _ in aims]
    with torch.no_grad():
        for number in range(count):
            for own, aim, (c, _) in zip(chosen, aims, search.each(problem, aims, generators, begin)):
                _take(problem, aim, search, c)
                own.append(c)
            report(number + 1, count)
    nothing = torch.zeros(0, *problem.trajectory.shape, dtype=torch.float64)
    return [torch.stack(own) if own else nothing for own in chosen]


def _take(problem: Problem, aim: Prediction, search: Search, c: Tensor) -> None:
    aim.take(told(problem, aim, c[None], search._points(problem, 4)))


def _now(aim: Prediction) -> float:
    """The aim's value without another trajectory."""
    known = aim.known
    nothing = (torch.zeros_like(x)[None] for x in (known.information, known.lasting))
    none = Told(next(nothing), next(nothing), known.lasting.new_zeros(1, len(aim.tasks), 1))
    return float(aim.value(none)[0])
