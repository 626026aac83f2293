"""What the benchmarks run on: the LWR on its desk, at the paper's trajectories."""

from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from sidegan.design.problem import Problem
from sidegan.gan import TrajectoryGenerator
from sidegan.gan.networks import Generator
from sidegan.gan.scaling import Scaling
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import load_robot
from sidegan.validity import Constraints, Plane

DESK = Plane((0.0, 0.0, 1.0), 0.10)
_QUICK = 10  # times smaller


@dataclass(frozen=True)
class Setting:
    """Arm, workspace and sizes.

    Attributes:
        quick: a tenth of the work: whether everything runs, not how fast it is.
        repeats: timed runs of each benchmark.
    """

    quick: bool = False
    repeats: int = 5

    def size(self, full: int) -> int:
        """The number itself, or a tenth of it in quick mode."""
        return max(1, full // _QUICK) if self.quick else full

    @cached_property
    def problem(self) -> Problem:
        """The seeds' optimisation problem at the default number of samples: the LWR above its desk."""
        arm = load_robot("kuka_lwr4")
        return Problem(Constraints(arm, [DESK]), Trajectory(arm.joints))

    def start(self, count: int) -> Tensor:
        """Random trajectories, (count, 7, 6, 2) [rad/s]; the same each time."""
        return self.problem.start(count, torch.Generator().manual_seed(0))

    def untrained(self) -> TrajectoryGenerator:
        """A generator of the default size that yields the Gaussian of random trajectories."""
        seeds, trajectory, arm = self.start(200), self.problem.trajectory, self.problem.constraints.arm
        scaling = Scaling.fit(seeds)
        network = Generator(*trajectory.shape[:2], shortcut=True)
        network.start_from(scaling.image(seeds))
        return TrajectoryGenerator(network.eval(), scaling, trajectory, arm.name, arm.digest, "untrained")
