"""The paper's optimiser of seeds: ant colony for a rough global solution, compass search to fine-tune.

Source: Jegorova et al. 2020, section V-A, with pygmo's ``gaco`` (Schlueter et al. 2009) and
``compass_search`` (Kolda, Lewis, Torczon 2003).
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor

from sidegan.design.evaluation import Evaluation
from sidegan.design.problem import Problem
from sidegan.seeds.result import SeedBatch, collect

if TYPE_CHECKING:
    import pygmo

_RANGE = 0.3  # share of a joint's velocity limit that one coefficient may take
_USE = 0.995  # of its tightest limit, to which a joint is scaled down; the rest is for what samples miss
_DISTANCE = 1.0  # [m] clearance that counts like a whole limit
_COMPASS_STEP, _COMPASS_STOP = 0.3, 1e-4  # first and last step, as shares of the box
_SEED_LIMIT = 2**31  # pygmo takes seeds below this


class ConditionProblem:
    """One trajectory as a pygmo problem: log fitness, and a violated margin above zero per constraint.

    The decision vector is the coefficients over their range, (J · H · 2,), each in [−1, 1], before the
    joints are scaled into their limits.
    """

    def __init__(self, problem: Problem) -> None:
        self.evaluation = Evaluation(problem, _USE, _DISTANCE)
        arm, shape = problem.constraints.arm, problem.trajectory.shape
        self.range = np.broadcast_to(_RANGE * arm.velocity_limit.numpy()[:, None, None], shape)

    def __deepcopy__(self, memory: dict[int, Any]) -> "ConditionProblem":
        return self  # pygmo copies its problems; this one never changes, and its room to work is large

    def fitness(self, x: np.ndarray) -> np.ndarray:
        """Log fitness and violations, (1 + G,)."""
        return self.batch_fitness(x)

    def batch_fitness(self, x: np.ndarray) -> np.ndarray:
        """The same of B decision vectors laid end to end, (B · (1 + G),)."""
        return self.evaluation(self._unscaled(x)).ravel()

    def coefficients(self, x: np.ndarray) -> Tensor:
        """Coefficients [rad/s], (B, J, H, 2), of decision vectors laid end to end.

        A joint that would exceed its position or velocity limit is scaled down to it. That is ours, not the
        paper's: without it none of six searches of 20,000 evaluations on the LWR ended feasible, in boxes of
        0.3 and of 0.1 of the velocity limits.
        """
        return self.evaluation.scaled(torch.from_numpy(self._unscaled(x)))

    def _unscaled(self, x: np.ndarray) -> np.ndarray:
        return x.reshape(-1, *self.range.shape) * self.range

    def get_bounds(self) -> tuple[list[float], list[float]]:
        """Lower and upper bounds of the decision vector."""
        return [-1.0] * self.range.size, [1.0] * self.range.size

    def get_nic(self) -> int:
        """Number of inequality constraints."""
        return len(self.evaluation.problem.constraints.labels)


@dataclass(frozen=True)
class Paper:
    """Ant colony, then compass search, one trajectory after the other."""

    generations: int  # of the colony
    ants: int  # size of the colony
    evaluations: int  # most of the compass search
    attempts: int  # most starts per seed

    def optimise(self, problem: Problem, count: int, seed: np.random.SeedSequence) -> SeedBatch:
        """Up to ``count`` seeds, (n, J, H, 2) [rad/s]; see ``collect``."""
        udp = ConditionProblem(problem)

        def propose(missing: int, reach: float, source: np.random.SeedSequence) -> Tensor:
            return torch.cat([self._search(udp, child) for child in source.spawn(missing)])

        return collect(problem, count, seed, self.attempts, propose)

    def _search(self, udp: ConditionProblem, source: np.random.SeedSequence) -> Tensor:
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
        return udp.coefficients(_best(refined))


def _best(population: "pygmo.population") -> np.ndarray:
    """The feasible decision vector with the least fitness, or the least violating one."""
    values, vectors = population.get_f(), population.get_x()
    violation = np.clip(values[:, 1:], 0, None).sum(1)
    return vectors[np.lexsort((values[:, 0], violation))[0]]
