"""What an optimiser without gradients asks of single trajectories: log fitness and worst margins.

One question costs 0.2 ms where kernels are compiled, and most of it is arithmetic; elsewhere plain torch
answers.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import torch

from sidegan.design.problem import Problem
from sidegan.motion.backend import usable
from sidegan.robot import HIGHER

if TYPE_CHECKING:
    from sidegan.design.compiled import CompiledEvaluation

# That kernels know, in their order.
NAMES = ("position", "velocity", "torque", "collision", "keep_out", *HIGHER)


@dataclass(frozen=True)
class Evaluation:
    """Log fitness and violations of trajectories of a problem, at its samples."""

    problem: Problem
    distance: float  # clearance that counts like a whole limit [m]

    def __call__(self, c: np.ndarray) -> np.ndarray:
        """Log fitness, and the worst relative margin of each constraint with its sign turned, (B, 1 + G).

        Coefficients [rad/s] are (B, J, H, 2); constraints are in the order of their labels.
        """
        return self._compiled(c) if self._compiled is not None else self.plain(c)

    @torch.no_grad()
    def plain(self, coefficients: np.ndarray) -> np.ndarray:
        """The same by torch: the reference."""
        c = torch.from_numpy(coefficients)
        constraints = self.problem.constraints
        states = (part.flatten(0, 1) for part in self.problem.states(c))
        shares = constraints.relative(constraints.margins(*states), self.distance)
        violations = [-share.reshape(len(c), -1).amin(1) for share in shares.values()]
        return torch.stack([self.problem.fitness(c).log(), *violations], 1).numpy()

    @cached_property
    def _compiled(self) -> "CompiledEvaluation | None":
        """The kernel, where it can be had and knows the motion and every constraint."""
        known = set(self.problem.constraints.labels) <= set(NAMES)
        kind = type(self.problem)
        moves_so = kind.motion is Problem.motion and kind.jerk is Problem.jerk
        if not (known and moves_so and usable(self.problem.body.base.values)):
            return None
        from sidegan.design.compiled import CompiledEvaluation

        return CompiledEvaluation(self.problem, self.distance)
