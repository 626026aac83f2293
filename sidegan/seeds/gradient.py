"""The default optimiser of seeds: a whole batch at once, with exact gradients, in torch."""

import time
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from sidegan.seeds.lbfgs import BatchedLbfgs, Function
from sidegan.seeds.objective import Penalty, value_and_gradient
from sidegan.seeds.problem import HOPELESS, SeedProblem
from sidegan.seeds.result import SeedBatch, collect, torch_generator

# At first violations cost little and few samples do: the search moves freely. Then it becomes strict.
_ROUGH, _STRICT = Penalty(30.0), Penalty(300.0)
_ROUGH_SHARE = 0.7  # of the steps
_ROUGH_SAMPLES = 0.6  # of the samples


@dataclass(frozen=True)
class Gradient:
    """Batched L-BFGS on the log of the condition number, with penalties for violations.

    Args:
        steps: evaluations per start.
        attempts: most rounds of starts.
        starts: starts per seed; the best conditioned are kept.
        seconds: CPU time [s] after which a round stops, wherever it is; it ends all further rounds.
            Results then depend on the machine's speed.
        ceiling: largest fitness of a seed.
        memory: correction pairs of the L-BFGS.

    Example: ``Gradient(steps=200).optimise(problem, 100, np.random.SeedSequence(0))``.
    """

    steps: int = 200
    attempts: int = 5
    starts: int = 1
    seconds: float | None = None
    ceiling: float = HOPELESS
    memory: int = 25

    def optimise(self, problem: SeedProblem, count: int, seed: np.random.SeedSequence) -> SeedBatch:
        """Up to ``count`` seeds, (n, J, H, 2) [rad/s]; see ``collect``."""
        clock = _Clock(self.seconds)

        def propose(missing: int, reach: float, source: np.random.SeedSequence) -> Tensor:
            if clock.share() >= 1:
                return torch.zeros(0, *problem.trajectory.shape, dtype=torch.float64)
            return self._descend(problem, missing * self.starts, reach, torch_generator(source), clock)

        return collect(problem, count, seed, self.attempts, propose, self.ceiling)

    def _descend(
        self, problem: SeedProblem, count: int, reach: float, generator: torch.Generator, clock: "_Clock"
    ) -> Tensor:
        few = max(int(_ROUGH_SAMPLES * problem.samples), 2 * problem.trajectory.harmonics + 1)
        x = problem.start(count, generator, reach).flatten(1)
        rough = _function(replace(problem, samples=few), _ROUGH)
        search = BatchedLbfgs(rough, x, self.memory)
        first = round(_ROUGH_SHARE * self.steps)
        self._iterate(search, first, clock, _ROUGH_SHARE)
        search.restart(_function(problem, _STRICT))
        self._iterate(search, self.steps - first, clock, 1.0)
        return search.x.reshape(count, *problem.trajectory.shape)

    @staticmethod
    def _iterate(search: BatchedLbfgs, steps: int, clock: "_Clock", until: float) -> None:
        for _ in range(steps):
            if clock.share() >= until:
                break
            search.iterate()


class _Clock:
    def __init__(self, seconds: float | None) -> None:
        self.seconds, self.began = seconds, time.process_time()

    def share(self) -> float:
        """Share of the CPU time that is used up; zero when it is unlimited."""
        return (time.process_time() - self.began) / self.seconds if self.seconds else 0.0


def _function(problem: SeedProblem, penalty: Penalty) -> Function:
    def function(x: Tensor) -> tuple[Tensor, Tensor]:
        value, gradient = value_and_gradient(problem, x.reshape(-1, *problem.trajectory.shape), penalty)
        return value, gradient.flatten(1)

    return function
