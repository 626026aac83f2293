"""The default optimiser of seeds: compiled gradient descent from random starts."""

from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array
from sidegan.design.problem import Problem
from sidegan.seeding.result import Optimiser


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
