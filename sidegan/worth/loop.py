"""Ways to choose the next trajectory of a plant, of which some listen to what is known of it by then."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import torch
from torch import Tensor

from sidegan.design.information import information_of
from sidegan.design.optimal import d_optimal
from sidegan.design.prediction import Prediction
from sidegan.design.problem import Problem
from sidegan.design.sequence import Begin, Search, told
from sidegan.designer import Aim, Designer, noise_at
from sidegan.designer.aim import Kind
from sidegan.errors import InfeasibleError
from sidegan.identification import TorqueModel
from sidegan.motion.trajectory import Trajectory
from sidegan.worth.curves import Truth, mean_error
from sidegan.worth.orders import SetOf
from sidegan.worth.session import Known, Session


class Way(Protocol):
    """How the next trajectory is chosen."""

    def next(self, known: Known) -> Tensor:
        """Coefficients (J, H, 2) [rad/s] of the next one."""


@dataclass
class Listed:
    """Trajectories in an order that was fixed before, again from the first when all were executed."""

    coefficients: Tensor  # (N, J, H, 2)
    _number: int = 0

    def next(self, known: Known) -> Tensor:
        """The next of the list."""
        self._number += 1
        return self.coefficients[(self._number - 1) % len(self.coefficients)]


@dataclass
class Picked:
    """The trajectory of a pool that tells most beside what is known: log det of rigid bodies' information."""

    model: TorqueModel
    family: Trajectory
    pool: Tensor  # (N, J, H, 2)

    def next(self, known: Known) -> Tensor:
        """The best of the pool."""
        deviation = (known.intensity / self.family.period).sqrt()
        found = information_of(self.model.body, self.family, self.pool, deviation=deviation)
        return self.pool[int(d_optimal(found, 1, known.rigid(self.model))[0])]


@dataclass
class Designed:
    """The designer's trajectory beside what is known of the whole model, friction and rotors included.

    For log det of the information or, with tasks, for the variance of torques that are predicted for them.
    """

    model: TorqueModel
    designer: Designer
    evaluations: int
    tasks: Tensor | None = None  # mean YᵀY over squared torques, (P, P)

    def next(self, known: Known) -> Tensor:
        """A trajectory that was designed now.

        Raises:
            InfeasibleError: when none is proven.
        """
        noise = noise_at(self.designer.settings.rate, 1 / known.intensity)
        tasks = None if self.tasks is None else self.tasks.numpy()
        kind: Kind = "determinant" if tasks is None else "variance"
        aim = Aim(kind, known.information.numpy(), noise, model=self.model, tasks=tasks)
        design = self.designer.ask(aim=aim, evaluations=self.evaluations)
        if design.coefficients is None:
            raise InfeasibleError("; ".join(design.blocked))
        return design.coefficients


@dataclass
class Predicted:
    """The trajectory with the smallest expected error on tasks beside what is known."""

    problem: Problem
    aim: Prediction
    search: Search
    generator: torch.Generator
    begin: Begin | None = None  # where the search begins, if not anywhere
    _chosen: list[Tensor] = field(default_factory=list)

    def next(self, known: Known) -> Tensor:
        """A trajectory that was designed now.

        Raises:
            InfeasibleError: when no search ends within the constraints.
        """
        self.aim.believe(known.information, 1 / known.intensity)
        with torch.no_grad():
            for c in self._chosen:  # their bias; what they told is known already
                one = told(self.problem, self.aim, c[None], self.problem.samples)
                self.aim.take(one._replace(information=torch.zeros_like(one.information)))
            c, _ = self.search.one(self.problem, self.aim, self.generator, self.begin)
        self._chosen.append(c)
        return c


class Step(NamedTuple):
    """What is known after a trajectory."""

    seconds: float  # of motion until then
    deviation: float  # of predicted torque on the tasks that are designed for, as a share of it
    error: float  # of predicted torque on held-out tasks, as a share
    covered: float  # of the parameters by their 95 % intervals; not a number where they have no true values
    design: float  # CPU time of the choice [s]
    known: Known


def closed(
    session: Session,
    way: Way,
    family: Trajectory,
    count: int,
    tasks: Tensor,
    truth: Truth,
    true: Tensor | None,
) -> list[Step]:
    """Choose, execute and identify, so many times.

    Args:
        session: the plant.
        way: how the next trajectory is chosen.
        family: of the trajectories.
        count: how many are executed.
        tasks: mean YᵀY over squared torques of the tasks that are designed for, (P, P).
        truth: the plant on held-out tasks.
        true: its parameters, where it has any, (P,).
    """
    steps: list[Step] = []
    for _ in range(count):
        began = time.process_time()
        c = way.next(session.known)
        took = time.process_time() - began
        known = session.execute(SetOf(family, c[None]))
        error = float(mean_error(truth.errors(known.parameters)))
        covered = float("nan") if true is None else known.covered(true)
        steps.append(Step(session.seconds, known.deviation(tasks), error, covered, took, known))
    return steps


def seconds_to(steps: Sequence[Step], target: float) -> float:
    """Seconds of motion until the deviation is at most a target; infinite where it is not reached."""
    return next((one.seconds for one in steps if one.deviation <= target), float("inf"))
