"""The default optimiser of seeds: a whole batch at once, with exact gradients, in torch."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from sidegan.design.coordinates import Coordinates, objective
from sidegan.design.lbfgs import BatchedLbfgs
from sidegan.design.penalty import Penalty
from sidegan.design.problem import Problem
from sidegan.seeds.result import SeedBatch, collect

# At first violations cost little and few samples do: the search moves freely. Then it becomes strict.
_ROUGH, _STRICT = 30.0, 300.0  # weights of the penalty
_ROUGH_SHARE = 0.7  # of the steps
_ROUGH_SAMPLES = 0.6  # of the samples


@dataclass(frozen=True)
class Gradient:
    """Batched L-BFGS on the log condition number in natural coordinates, with penalties for violations.

    Example: ``Gradient(200, 5, reserve=0.2).optimise(problem, 100, np.random.SeedSequence(0))``.
    """

    steps: int  # evaluations per start
    attempts: int  # most rounds of starts
    # share of each limit that seeds keep free, and twice that share of 0.25 m as clearance. The more, the
    # easier a generator trained on them stays valid, and the worse they are conditioned
    reserve: float

    def optimise(self, problem: Problem, count: int, seed: np.random.SeedSequence) -> SeedBatch:
        """Up to ``count`` seeds, (n, J, H, 2) [rad/s]; see ``collect``."""

        def propose(missing: int, reach: float, source: np.random.SeedSequence) -> Tensor:
            seed = int(source.generate_state(1, np.uint64)[0] >> 1)
            return self._descend(problem, missing, reach, torch.Generator().manual_seed(seed))

        return collect(problem, count, seed, self.attempts, propose)

    def _descend(self, problem: Problem, count: int, reach: float, generator: torch.Generator) -> Tensor:
        few = max(int(_ROUGH_SAMPLES * problem.samples), 2 * problem.trajectory.harmonics + 1)
        coordinates = Coordinates.of(problem)
        x = coordinates.start(problem, count, generator, reach)
        rough, strict = (Penalty.reserving(weight, self.reserve) for weight in (_ROUGH, _STRICT))
        search = BatchedLbfgs(objective(replace(problem, samples=few), rough, coordinates), x)
        first = round(_ROUGH_SHARE * self.steps)
        search.run(first)
        search.restart(objective(problem, strict, coordinates))
        search.run(self.steps - first)
        return coordinates.coefficients(search.x)
