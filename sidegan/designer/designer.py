"""The designer: the best proven trajectory for one situation within milliseconds."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from torch import Tensor

from sidegan.design.criteria import Criteria, criteria_of
from sidegan.design.information import information_of
from sidegan.designer.aim import Aim
from sidegan.designer.descent import Penalties
from sidegan.designer.proof import Prover, Verdict
from sidegan.designer.pursuit import Budget, Pace, Pursuit
from sidegan.designer.scene import ArmNumbers, Scene
from sidegan.designer.settings import DesignerSettings
from sidegan.designer.situation import Situation
from sidegan.errors import ConfigError, InfeasibleError
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Box, Constraints, Plane
from sidegan.validity.constraints import NAMES

Array = np.ndarray


@dataclass(frozen=True)
class Spent:
    """What an answer took."""

    evaluations: int  # of the objective, those beside the search included
    proofs: int
    seconds: float  # by the designer's clock


@dataclass(frozen=True, eq=False)
class Design:
    """A proven trajectory, or what stands in the way of one."""

    coefficients: Tensor | None  # (J, H, 2) [rad/s]; None where no trajectory was proven
    trajectory: Trajectory  # the family it is of, with its home and its period
    margins: dict[str, float]  # smallest margins of the trajectory [rad, rad/s, N·m, m]
    blocked: tuple[str, ...]  # what stands in the way where there is none
    excepted: tuple[str, ...]  # links that can never leave a region, so that it is not checked
    spent: Spent
    numbers: ArmNumbers
    scene: Scene | None

    @property
    def constraints(self) -> Constraints:
        """The situation as ``sidegan.validity.check`` takes it.

        Raises:
            InfeasibleError: where the situation itself is impossible.
        """
        if self.scene is None:
            raise InfeasibleError("; ".join(self.blocked))
        return self.numbers.among(self.scene)

    @cached_property
    def information(self) -> Tensor:
        """Information per sample of noise 1, (p, p), in the orthonormal basis.

        Raises:
            InfeasibleError: where there is no trajectory.
        """
        if self.coefficients is None:
            raise InfeasibleError("; ".join(self.blocked))
        body = self.numbers.constraints.body
        return information_of(body, self.trajectory, self.coefficients[None]).matrices(slice(None))[0]

    @cached_property
    def criteria(self) -> Criteria:
        """What the trajectory alone tells: its condition number and the like."""
        return criteria_of(self.information)


class Designer:
    """Designs trajectories of one arm in its workspace, again and again; not to be shared among threads.

    Args:
        constraints: the arm in its workspace.
        trajectory: the family, with the home and the period where no other is asked for.
        settings: how.
        clock: what deadlines are read from [s].
        seed: of random points.
    """

    def __init__(
        self,
        constraints: Constraints,
        trajectory: Trajectory,
        settings: DesignerSettings,
        clock: Callable[[], float] = time.perf_counter,
        seed: int = 0,
    ) -> None:
        from sidegan.designer.compiled import Descents

        self.settings, self.clock, self.seed = settings, clock, seed
        self.numbers = ArmNumbers(constraints, trajectory)
        self._pace = Pace()
        self.descents, self.prover = Descents(self.numbers, settings), Prover(self.numbers)
        self._warm_up()

    def _warm_up(self) -> None:
        """Load whatever is compiled, so that the first answer does not wait for it."""
        situation = Situation(regions=[Plane((0.0, 0.0, 1.0), -1e3), Box((1e3,) * 3, (1e3 + 1,) * 3)])
        scene = self.numbers.scene(situation)
        still = np.zeros_like(scene.size)
        descent = self.descents.descent(scene, Aim(), Penalties(1.0, 0.0, 0.0, 0.0))
        descent.place(still)
        descent.run(1)
        descent.evaluate(still, still)
        self.prover.prove(scene, still)

    def ask(
        self,
        situation: Situation | None = None,
        aim: Aim | None = None,
        evaluations: int | None = None,
        deadline: float | None = None,
    ) -> Design:
        """The best proven trajectory after so many evaluations, or when the deadline [s] has come.

        The same number of evaluations gives the same answer. A trajectory is never returned without a proof;
        where there is none, the answer says what stands in the way.

        Raises:
            ConfigError: when neither evaluations nor a deadline are given, or an impossible one.
            ShapeError: for a home, a prior or noise that do not fit the arm.
        """
        if evaluations is None and deadline is None:
            raise ConfigError("a design needs a number of evaluations, a deadline, or both")
        if (evaluations is not None and evaluations < 1) or (deadline is not None and not deadline > 0):
            raise ConfigError(f"{evaluations} evaluations in {deadline} s: expected positive numbers")
        budget = Budget(self.clock, self._pace, evaluations, deadline)
        situation, aim = situation or Situation(), aim or Aim()
        try:
            scene = self.numbers.scene(situation)
        except InfeasibleError as error:
            return self._answer(None, None, budget, None, (str(error),))
        at_home = self.prover.prove(scene, np.zeros_like(scene.size))
        if not at_home.valid:
            blocked = tuple(f"at home, {fault}" for fault in self._faults(scene, at_home, timed=False))
            return self._answer(scene, None, budget, None, blocked)
        random = np.random.default_rng(self.seed)
        pursuit = Pursuit(self.numbers, self.settings, self.prover, scene, at_home, budget, random)
        descent = self.descents.descent(scene, aim, pursuit.penalties)
        c, verdict = pursuit.run(descent)
        if c is None or verdict is None:
            faults = () if verdict is None else self._faults(scene, verdict)
            return self._answer(scene, None, budget, None, (*faults, "no trajectory was proven in time"))
        return self._answer(scene, c, budget, verdict, ())

    def _faults(self, scene: Scene, verdict: Verdict, timed: bool = True) -> list[str]:
        labels = self.numbers.among(scene).labels
        return [
            f"{name} of {labels[name][verdict.elements[k]]}"
            + (f" at {verdict.times[k]:.3f} s: " if timed else ": ")
            + f"margin {verdict.margins[k]:.4g}"
            for k, name in enumerate(NAMES)
            if not verdict.margins[k] >= 0
        ]

    def _answer(
        self,
        scene: Scene | None,
        c: Array | None,
        budget: Budget,
        verdict: Verdict | None,
        blocked: tuple[str, ...],
    ) -> Design:
        shape = self.numbers.trajectory.shape
        coefficients = None if c is None else torch.from_numpy(np.ascontiguousarray(c)).reshape(shape)
        family = self.numbers.trajectory if scene is None else self.numbers.family(scene)
        margins = {} if verdict is None else dict(zip(NAMES, verdict.margins.tolist()))
        margins = {name: margin for name, margin in margins.items() if margin < np.inf}
        excepted = () if scene is None else scene.excepted
        spent = Spent(budget.evaluations + budget.looks, budget.proofs, budget.seconds)
        return Design(coefficients, family, margins, blocked, excepted, spent, self.numbers, scene)
