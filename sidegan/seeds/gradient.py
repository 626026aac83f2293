"""The default optimiser of seeds: a whole batch at once, with exact gradients, in torch."""

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
        ceiling: largest fitness of a seed.
        memory: correction pairs of the L-BFGS.
        long: search among coefficients that suit a long period (``long_shaping``).

    Example: ``Gradient(steps=200).optimise(problem, 100, np.random.SeedSequence(0))``.
    """

    steps: int = 200
    attempts: int = 5
    ceiling: float = HOPELESS
    memory: int = 25
    long: bool = False

    def optimise(self, problem: SeedProblem, count: int, seed: np.random.SeedSequence) -> SeedBatch:
        """Up to ``count`` seeds, (n, J, H, 2) [rad/s]; see ``collect``."""

        def propose(missing: int, reach: float, source: np.random.SeedSequence) -> Tensor:
            return self._descend(problem, missing, reach, torch_generator(source))

        return collect(problem, count, seed, self.attempts, propose, self.ceiling)

    def _descend(self, problem: SeedProblem, count: int, reach: float, generator: torch.Generator) -> Tensor:
        few = max(int(_ROUGH_SAMPLES * problem.samples), 2 * problem.trajectory.harmonics + 1)
        shape = problem.trajectory.shape
        shaping = long_shaping(shape[1]) if self.long else torch.eye(2 * shape[1], dtype=torch.float64)
        start = problem.start(count, generator, reach, shaping if self.long else None)
        x = (start.flatten(2) @ torch.linalg.pinv(shaping).T).flatten(1)
        rough = _function(replace(problem, samples=few), _ROUGH, shaping)
        search = BatchedLbfgs(rough, x, self.memory)
        first = round(_ROUGH_SHARE * self.steps)
        for _ in range(first):
            search.iterate()
        search.restart(_function(problem, _STRICT, shaping))
        for _ in range(self.steps - first):
            search.iterate()
        return _shaped(search.x, shaping, shape)


def long_shaping(harmonics: int) -> Tensor:
    """Map from white coefficients to those that suit a period of many seconds, (2 H, 2 H).

    Every harmonic gets the same position amplitude, so the first ones do not use up the joint's range.
    Those directions are removed in which the waves alone are not at rest at the ends: the quintic would
    have to undo a velocity over the whole period, and would need hundreds of radians for it.
    """
    order = torch.arange(1, harmonics + 1, dtype=torch.float64)
    zero = torch.zeros_like(order)
    velocity = torch.stack([order, zero], 1).flatten()  # Σ a_k, in white coefficients
    acceleration = torch.stack([zero, order**2], 1).flatten()  # Σ k b_k
    normals = torch.stack([velocity / velocity.norm(), acceleration / acceleration.norm()], 1)
    rest = torch.eye(2 * harmonics, dtype=torch.float64) - normals @ normals.T
    return order.repeat_interleave(2)[:, None] * rest


def _shaped(x: Tensor, shaping: Tensor, shape: tuple[int, int, int]) -> Tensor:
    return (x.reshape(len(x), shape[0], -1) @ shaping.T).reshape(len(x), *shape)


def _function(problem: SeedProblem, penalty: Penalty, shaping: Tensor) -> Function:
    def function(x: Tensor) -> tuple[Tensor, Tensor]:
        value, gradient = value_and_gradient(problem, _shaped(x, shaping, problem.trajectory.shape), penalty)
        return value, (gradient.flatten(2) @ shaping).flatten(1)

    return function
