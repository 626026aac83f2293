"""Optimisers of seeds: compiled gradient descent, the default, and the paper's, by pygmo.

Source of the latter: Jegorova et al. 2020, section V-A: ant colony for a rough global solution, ``gaco``
(Schlueter et al. 2009), compass search to fine-tune, ``compass_search`` (Kolda, Lewis, Torczon 2003).
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.extras import extra
from sidegan.design.problem import Problem
from sidegan.seeding.optimise import Optimiser

if TYPE_CHECKING:
    import pygmo

# First and last step of the compass search, as shares of the box; inferred from the authors' seeds.
_COMPASS_STEP, _COMPASS_STOP = 0.5, 0.2
_SEED_LIMIT = 2**31  # pygmo takes seeds below this


@dataclass(frozen=True)
class Gradient(Optimiser):
    """L-BFGS on the log condition number in natural coordinates, with penalties for violations.

    Example: ``Gradient(200, 5, reserve=0.2).optimise(problem, 100, np.random.SeedSequence(0))``.
    """

    steps: int  # evaluations per start
    attempts: int  # most rounds of starts
    # share of each limit that seeds keep in reserve, and twice that share of 0.25 m as clearance; a larger
    # one makes it easier for a generator to stay valid, but worsens the seeds' conditioning
    reserve: float

    def propose(self, problem: Problem, count: int, reach: float, source: np.random.SeedSequence) -> Array:
        """Candidates [rad/s], (count, J, H, 2), each from its own descent."""
        from sidegan.design.objective import Goal
        from sidegan.design.search import Descent  # imports compiled code

        descent = Descent(problem, Goal(), self.reserve)
        random = np.random.default_rng(source)
        return np.stack([descent.run(descent.start(random, reach), self.steps) for _ in range(count)])


class ConditionProblem:
    """A trajectory as a pygmo problem: log fitness, and a violation, positive if violated, per constraint.

    The decision vector is all a, then all b, relative to their box, (2 · J · H,), each in [−1, 1]. The
    compass search changes one element after another in this order, so that coefficients a end at a bound of
    the box more often than b.
    """

    def __init__(self, problem: Problem, box: float) -> None:
        from sidegan.design.objective import evaluator  # imports compiled code

        self.evaluate = evaluator(problem)
        self.constraints = len(problem.constraints.labels)
        self.box = box
        self.shape = problem.trajectory.shape

    def __deepcopy__(self, memory: dict[int, Any]) -> "ConditionProblem":
        return self  # pygmo copies its problems; this one is immutable, with large work arrays

    def fitness(self, x: Array) -> Array:
        """Log fitness and violations of B concatenated decision vectors, (B · (1 + G),)."""
        return self.evaluate(self.coefficients(x)).ravel()

    batch_fitness = fitness

    def coefficients(self, x: Array) -> Array:
        """Coefficients [rad/s], (B, J, H, 2), of concatenated decision vectors."""
        joints, harmonics, pair = self.shape
        return np.ascontiguousarray(np.moveaxis(self.box * x.reshape(-1, pair, joints, harmonics), 1, -1))

    def get_bounds(self) -> tuple[list[float], list[float]]:
        """Lower and upper bounds of the decision vector."""
        size = math.prod(self.shape)
        return [-1.0] * size, [1.0] * size

    def get_nic(self) -> int:
        """Number of inequality constraints."""
        return self.constraints


@dataclass(frozen=True)
class Paper(Optimiser):
    """Ant colony, then compass search, for one trajectory at a time."""

    generations: int  # of the colony
    ants: int  # size of the colony
    evaluations: int  # limit of the compass search
    box: float  # largest absolute coefficient [rad/s]
    attempts: int  # most starts per seed

    smallest = 1.0  # candidates are not shrunk to become valid

    def propose(self, problem: Problem, count: int, reach: float, source: np.random.SeedSequence) -> Array:
        """Candidates [rad/s], (count, J, H, 2), each from its own search of the whole box."""
        udp = ConditionProblem(problem, self.box)
        return np.concatenate([self._search(udp, child) for child in source.spawn(count)])

    def _search(self, udp: ConditionProblem, source: np.random.SeedSequence) -> Array:
        with extra("paper"):
            import pygmo as pg

        first, second = (int(number) % _SEED_LIMIT for number in source.generate_state(2))
        population = pg.population(pg.problem(udp), self.ants, seed=first, b=pg.bfe(pg.member_bfe()))
        colony = pg.gaco(gen=self.generations, ker=min(63, self.ants), seed=second)
        colony.set_bfe(pg.bfe(pg.member_bfe()))
        population = pg.algorithm(colony).evolve(population)
        best = _best(population)
        refined = pg.population(pg.problem(udp))
        refined.push_back(best)
        compass = pg.compass_search(self.evaluations, _COMPASS_STEP, _COMPASS_STOP)
        refined = pg.algorithm(compass).evolve(refined)
        # Single precision, as in a file of seeds.
        return udp.coefficients(_best(refined)).astype(np.float32).astype(float)


def _best(population: "pygmo.population") -> Array:
    """The feasible decision vector with the least fitness, or else the least infeasible one."""
    values = population.get_f()
    vectors = population.get_x()
    violation = np.clip(values[:, 1:], 0, None).sum(1)
    return vectors[np.lexsort((values[:, 0], violation))[0]]
