"""Seeds by the designer's compiled loop: each start by itself, shared among threads."""

from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from sidegan.base.threads import one_thread
from sidegan.design.penalty import Penalty
from sidegan.design.problem import Problem
from sidegan.designer.aim import Aim
from sidegan.designer.descent import Penalties
from sidegan.designer.scene import ArmNumbers, Scene
from sidegan.designer.situation import Situation
from sidegan.motion.threads import each
from sidegan.seeds.result import SeedBatch, collect

if TYPE_CHECKING:
    from sidegan.designer.compiled import Descent

Array = np.ndarray

# At first violations cost little: the search moves freely. Then it becomes strict.
_ROUGH, _STRICT = 30.0, 300.0  # weights of the penalty
_ROUGH_SHARE = 0.7  # of the steps
_REFINE = 3  # finer points for each sample, for limits and distances
_FULL = 0.99  # share of its limits that a joint uses at most
_RATE = 100.0  # [Hz] of torques, which does not count for condition numbers


@dataclass(frozen=True)
class _Grid:
    """Where a descent looks at trajectories."""

    samples: int  # time points per period
    refine: int = _REFINE
    rate: float = _RATE


@dataclass(frozen=True)
class Compiled:
    """L-BFGS on the log condition number, of one trajectory after the other; an optimiser of seeds.

    The same search as ``sidegan.seeds.Gradient``, without what a batch costs, and on threads of this process.
    What it finds does not depend on their number.

    Example: ``Compiled(60, 5, reserve=0.05, threads=2).optimise(problem, 35, np.random.SeedSequence(0))``.
    """

    steps: int  # evaluations per start
    attempts: int  # most rounds of starts
    reserve: float  # share of each limit that is kept free, and twice that share of 0.25 m as clearance
    threads: int

    def optimise(self, problem: Problem, count: int, seed: np.random.SeedSequence) -> SeedBatch:
        """Up to ``count`` seeds, (n, J, H, 2) [rad/s]; see ``collect``."""
        numbers = ArmNumbers(problem.constraints, problem.trajectory)
        scene = numbers.scene(Situation())
        propose = partial(self._propose, problem, numbers, scene)
        with one_thread():  # torch's own would wait for each other: a set is little work
            return collect(problem, count, seed, self.attempts, propose)

    def _propose(
        self,
        problem: Problem,
        numbers: ArmNumbers,
        scene: Scene,
        count: int,
        reach: float,
        source: np.random.SeedSequence,
    ) -> Tensor:
        from sidegan.designer.compiled import Descents

        found = np.zeros((count, *scene.size.shape))
        sources = source.spawn(count)
        aim = Aim("diagonal" if problem.diagonal else "condition")
        left: SimpleQueue[int] = SimpleQueue()  # whoever is quicker takes more: a core is seldom alone
        for k in range(count):
            left.put(k)

        def work(thread: int) -> None:
            descents = Descents(numbers, _Grid(problem.samples))
            descent = descents.descent(scene, aim, self._penalties(_ROUGH))
            with suppress(Empty):
                while True:
                    k = left.get_nowait()
                    x = numbers.start(scene, np.random.default_rng(sources[k]), reach)
                    found[k] = self._descend(numbers, scene, descent, x)

        each(work, max(1, min(self.threads, count)))
        return torch.from_numpy(found).reshape(count, *problem.trajectory.shape)

    def _descend(self, numbers: ArmNumbers, scene: Scene, descent: "Descent", x: Array) -> Array:
        """Coefficients (J, K) [rad/s] that a start leads to."""
        first = round(_ROUGH_SHARE * self.steps)
        descent.penalise(self._penalties(_ROUGH))
        descent.place(x)
        descent.run(first)
        descent.penalise(self._penalties(_STRICT))
        descent.run(self.steps - first)
        return numbers.within(scene, descent.coefficients, _FULL)

    def _penalties(self, weight: float) -> Penalties:
        kept = Penalty.reserving(weight, self.reserve)
        return Penalties(weight, kept.limits, kept.torque, kept.reach)
