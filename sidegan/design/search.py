"""Search for trajectories: compiled descents from many starts, then a proof of validity.

Example, the best proven trajectory within 50 ms: ``search(problem, Goal(), settings, deadline=0.05)``.
"""

import logging
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from time import perf_counter as clock
from typing import Protocol

import numpy as np

from sidegan.base.arrays import Array
from sidegan.design.beside import compile_beside
from sidegan.design.excitation import enough_samples
from sidegan.design.objective import Goal, Objective, Penalty
from sidegan.design.problem import Coordinates, Problem, SearchSettings
from sidegan.errors import InfeasibleError
from sidegan.kernels import descent
from sidegan.kernels.objective import Plan
from sidegan.motion.dynamics import gram
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Validity, check
from sidegan.validity.remedies import binding, remedy

_ROUGH, _STRICT = 30.0, 300.0  # weights of the penalty: a small weight first lets the search move freely
_ROUGH_SHARE = 0.7  # share of evaluations with the small weight
_DENSE = 12  # least points per period of the highest harmonic for limits on motion and distances
_REFINE = 3  # finer points per sample, if the samples are fewer
_MEMORY = 25  # pairs of steps and gradient changes of L-BFGS
_REACH = 0.7  # share of its tightest limit that each joint of a start uses
_FULL = 0.99  # largest share of the limits on motion at the end of a descent
_SHARES = (1.0, 0.99, 0.975, 0.95, 0.9, 0.8, 0.65, 0.5, 0.3, 0.15, 0.05, 0.02)  # scales tried for validity
_SLIGHTLY = 0.9  # smallest scale tried after each descent; smaller ones only if all of them fail
_BETTER = 1e-3  # improvement of the goal that is worth a proof
_PROOF = 4e-3  # time reserved for a proof before a deadline [s]
_AGAIN = 4  # searches per trajectory, at most
_WHOLE, _SCRAP = 0.5, 0.2  # scales below which a trajectory is searched again, and left out
_SAMPLES = 80  # least time points for the information of a trajectory in a set

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Found:
    """A trajectory proven valid."""

    coefficients: Array  # (J, H, 2) [rad/s]
    value: float  # of the goal, a logarithm
    share: float = 1.0  # its scale relative to the result of the descent


class Descent:
    """L-BFGS from a start, with a small and then a large penalty; not thread-safe.

    ``reserve`` is the share of each limit to keep free, and half this number the distance [m].
    """

    def __init__(self, problem: Problem, goal: Goal, reserve: float) -> None:
        self.problem = problem
        self.coordinates = Coordinates.of(problem)
        rough = Penalty(_ROUGH, limits=reserve, torque=reserve, distance=2 * reserve)
        refine = 1 if problem.samples >= _DENSE * problem.trajectory.harmonics else _REFINE
        self._objective = Objective(problem, goal, rough, refine, self.coordinates.matrix)
        self._strict = self._objective.penalised(replace(rough, weight=_STRICT))
        joints, harmonics, _ = problem.trajectory.shape
        self._state = descent.descent_state(joints, 2 * harmonics, _MEMORY)

    def start(self, random: np.random.Generator, reach: float = _REACH) -> Array:
        """A random point, (J, 2 H), at which each joint uses ``reach`` of its tightest limit."""
        return self.coordinates.start(self.problem, 1, random, reach)[0]

    def run(self, x: Array, evaluations: int) -> Array:
        """Coefficients [rad/s], (J, H, 2), within the limits on motion, after a descent from a point."""
        first = round(_ROUGH_SHARE * evaluations)
        self._state.x[:] = x.ravel()
        for plan, count in ((self._objective.plan, first), (self._strict, evaluations - first)):
            self._descend(plan, count)
        c = self.coordinates.coefficients(self._state.x.reshape(1, *x.shape))
        return (c / np.maximum(self.problem.limit_use(c) / _FULL, 1.0)[:, :, None, None])[0]

    def value(self, c: Array) -> float:
        """The goal at coefficients [rad/s], (J, H, 2)."""
        self._state.x[:] = self.coordinates.points(c[None]).ravel()
        self._descend(self._objective.plan, 1)
        return float(self._state.numbers[descent.GOAL])

    def _descend(self, plan: Plan, evaluations: int) -> None:
        """Continue the descent for a number of evaluations, the first at the current point."""
        self._state.numbers[descent.STARTED] = 0.0
        descent.descend(plan, self._state, self._objective.scratch, evaluations)


def prove(problem: Problem, c: Array, smallest: float) -> tuple[Array, Array, Validity]:
    """Scale trajectories [rad/s], (B, J, H, 2), down until they are valid; also whether they are, (B,).

    They shrink towards home, but not below the scale ``smallest``; the verdict is that of the last check.
    """
    c = np.where(np.isfinite(c).all((1, 2, 3), keepdims=True), c, 0.0)
    valid = np.zeros(len(c), dtype=bool)
    for share in _SHARES:
        left = np.flatnonzero(~valid)
        verdict = check(problem.constraints, problem.trajectory, c[left] * share)
        c[left[verdict.valid]] *= share
        valid[left[verdict.valid]] = True
        if share <= smallest or valid.all():
            break
    return c, valid, verdict


def search(
    problem: Problem,
    goal: Goal,
    settings: SearchSettings,
    seed: int = 0,
    deadline: float | None = None,
) -> Found:
    """The best proven trajectory after the settings' evaluations, or within a deadline [s].

    The result is reproducible for a number of evaluations. The first call loads compiled kernels.

    Raises:
        InfeasibleError: when the arm cannot rest at home, or no trajectory is proven; names the violations.
        ShapeError: when the goal does not fit the arm.
    """
    began = clock()
    done, pace = 0, 0.0  # evaluations, and time per evaluation [s]
    compile_beside()
    problem = replace(problem, samples=max(settings.samples, 2 * problem.trajectory.harmonics + 1))
    problem.constraints.refuse_home(problem.trajectory.home or ())
    searching = Descent(problem, goal, settings.reserve)
    random = np.random.default_rng(seed)

    def left() -> int:
        if deadline is None:
            return settings.evaluations - done
        rest = deadline - _PROOF - (clock() - began)
        return math.ceil(rest / pace) if rest > 0 else 0

    if deadline is not None:
        before = clock()
        done = 2
        searching.run(searching.start(random), done)
        pace = max((clock() - before) / done, 1e-9)
    best, failed, verdict = None, None, None
    while (rest := left()) > (0 if best is None else settings.patience // 2):
        count = rest // max(1, rest // settings.patience)
        before = clock()
        c = searching.run(searching.start(random), count)[None]
        pace = max((clock() - before) / count, 1e-9)
        done += count
        least = math.inf if best is None else best.value - _BETTER
        if searching.value(c[0]) < least:
            shrunk, valid, verdict = prove(problem, c, _SLIGHTLY)
            if not valid.all():
                failed = c
            elif (value := searching.value(shrunk[0])) < least:
                best = Found(shrunk[0], value)
    if best is None and failed is not None:
        shrunk, valid, verdict = prove(problem, failed, _SHARES[-1])
        if valid.all():
            share = float(np.linalg.norm(shrunk) / np.linalg.norm(failed))
            best = Found(shrunk[0], searching.value(shrunk[0]), share)
    if best is None:
        faults = verdict.failures(0) if verdict else []
        reason = "; ".join(map(str, faults)) or "out of time"
        text = f"no trajectory was proven in {done} evaluations: {reason}"
        if faults:
            where = faults[0].constraint, faults[0].where
            text += f"; what may help: {remedy(problem.constraints, where)}"
        raise InfeasibleError(text)
    return best


class SetGoal(Protocol):
    """Goal of a set, given the trajectories that it already has."""

    def next(self) -> Goal:
        """The goal of the next trajectory."""

    def take(self, trajectory: Trajectory, c: Array) -> None:
        """Add a trajectory with coefficients [rad/s], (J, H, 2), to the set."""


class ConditionGoal:
    """The condition number of a whole set, for rigid bodies alone."""

    def __init__(self, problem: Problem) -> None:
        self._body = problem.body
        size = problem.body.parameters_count
        self._sum = np.zeros((size, size))

    def next(self) -> Goal:
        """The goal of the next trajectory."""
        return Goal("condition", prior=self._sum)

    def take(self, trajectory: Trajectory, c: Array) -> None:
        """Add a trajectory with coefficients [rad/s], (J, H, 2), to the set."""
        samples = enough_samples(trajectory, _SAMPLES)
        self._sum = self._sum + trajectory.period * gram(self._body, trajectory, c[None], samples)[0]


def design_set(problem: Problem, goal: SetGoal, count: int, settings: SearchSettings, seed: int) -> Array:
    """A set of proven trajectories [rad/s], (count, J, H, 2), each designed given those before it.

    A trajectory that had to be scaled down much is searched again. If it stays tiny, it is left out, unless
    all are; if none is proven, it is missing: the set may be smaller than ``count``. The goal takes what is
    in the set.

    Raises:
        InfeasibleError: when no first trajectory is proven.
    """
    kept, tiny, unproven = list[Array](), list[Array](), list[InfeasibleError]()
    for index in range(count):
        seeds = range(seed + index, seed + _AGAIN * count, count)
        try:
            found = _largest(problem, goal.next(), settings, seeds)
        except InfeasibleError as error:
            if not kept and not tiny:
                raise
            unproven.append(error)
            continue
        if found.share >= _SCRAP:
            kept.append(found.coefficients)
            goal.take(problem.trajectory, found.coefficients)
        else:
            tiny.append(found.coefficients)
    if not kept:
        kept, tiny = tiny, []
        for c in kept:
            goal.take(problem.trajectory, c)
    if tiny:
        where = binding(problem.constraints, problem.trajectory, np.stack(tiny))
        helps = f"what may help: {remedy(problem.constraints, where)}" if where else ""
        why = f", limited by {' of '.join(where)}; {helps}" if where else ""
        left_out = "%d of %d trajectories hardly move the arm and are left out%s"
        _log.warning(left_out, len(tiny), count, why)
    if unproven:
        _log.warning("%d of %d trajectories are missing: %s", len(unproven), count, unproven[-1])
    return np.stack(kept)


def _largest(problem: Problem, goal: Goal, settings: SearchSettings, seeds: Iterable[int]) -> Found:
    """The trajectory that was scaled down least, of searches that end with one that hardly was."""
    found: list[Found] = []
    for seed in seeds:
        try:
            found.append(search(problem, goal, settings, seed))
        except InfeasibleError as error:
            failed = error
        else:
            if found[-1].share >= _WHOLE:
                break
    if not found:
        raise failed
    return max(found, key=lambda trajectory: trajectory.share)
