"""Settings of the seed set and of the single long trajectory."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

from sidegan.base.typed import Count, Seconds, Share, Size
from sidegan.design.problem import Problem
from sidegan.errors import ConfigError
from sidegan.motion.trajectory import Trajectory
from sidegan.seeds.gradient import Gradient
from sidegan.seeds.make import Method
from sidegan.seeds.paper import Paper
from sidegan.validity import Constraints


@dataclass(frozen=True)
class Seeds:
    """The conventional optimiser that makes the seed set."""

    # compiled: as gradient, each start by itself, by ``sidegan.designer.Compiled`` where that serves
    method: Literal["gradient", "paper", "compiled"]
    fitness: Literal["eigenvalue", "diagonal"]
    count: Count
    samples: Size  # time points per period
    batch: Size  # trajectories per task
    steps: Count  # evaluations; paper: generations of the colony
    attempts: Count  # starts per seed before giving up
    reserve: Share | None = None  # not paper: share of each limit that seeds keep free
    enough: Count | None = None  # seeds that do where no more become valid; null: all
    ants: Size | None = None  # paper only: size of the colony
    evaluations: Count | None = None  # paper only: of the compass search

    def __post_init__(self) -> None:
        if self.method == "paper" and None in (self.ants, self.evaluations):
            raise ConfigError("method paper needs ants and evaluations; choose it by seeds=paper")
        if self.method != "paper" and (self.ants, self.evaluations) != (None, None):
            raise ConfigError(f"ants and evaluations are of method paper; choose seeds={self.method}")
        if (self.method == "paper") != (self.reserve is None):
            raise ConfigError(
                "methods gradient and compiled, and no others, need reserve; choose one by seeds=gradient"
            )

    def stamped(self) -> dict[str, Any]:
        """Plain values by which artifacts are known; how many are enough changes no seed."""
        return {name: x for name, x in asdict(self).items() if name != "enough"}

    @property
    def optimiser(self) -> Method:
        """The configured method; for ``compiled`` the batched search, which serves everywhere."""
        return self._optimiser(self.attempts)

    @property
    def single(self) -> Method:
        """The configured method with one start, however it ends."""
        return self._optimiser(1)

    @property
    def evaluations_per_start(self) -> int:
        """Trajectories that one start evaluates."""
        return self.steps * (self.ants or 1) + (self.evaluations or 0)

    def _optimiser(self, attempts: int) -> Method:
        if self.ants is not None and self.evaluations is not None:
            return Paper(self.steps, self.ants, self.evaluations, attempts)
        return Gradient(self.steps, attempts, self.reserve or 0.0)

    def problem(self, constraints: Constraints, trajectory: Trajectory) -> Problem:
        """What the optimiser works on."""
        return Problem(constraints, trajectory, self.samples, diagonal=self.fitness == "diagonal")


@dataclass(frozen=True)
class Long:
    """The single long trajectory that the short ones are compared with; it is optimised as the seeds are."""

    period: Seconds
    harmonics: list[Size]  # one trajectory for each
    samples: Size
    steps: Count | None  # of each start, as the seeds have them; null: as many as a seed
    starts: Count  # of which the best is kept
