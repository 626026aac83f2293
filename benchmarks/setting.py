"""What the benchmarks run on: the LWR on its desk, at the paper's trajectories."""

from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from sidegan.design.problem import Problem
from sidegan.gan import TrajectoryGenerator
from sidegan.gan.networks import Generator
from sidegan.gan.scaling import Scaling
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm, load_robot
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
    def arm(self) -> Arm:
        """The KUKA LWR IV."""
        return load_robot("kuka_lwr4")

    @cached_property
    def trajectory(self) -> Trajectory:
        """The paper's short trajectories."""
        return Trajectory(self.arm.joints)

    @cached_property
    def constraints(self) -> Constraints:
        """The arm 10 cm above its desk."""
        return Constraints(self.arm, [DESK])

    @property
    def body(self) -> RigidBody:
        """Dynamics of the arm."""
        return self.constraints.body

    @cached_property
    def problem(self) -> Problem:
        """The seeds' optimisation problem at the default number of samples."""
        return Problem(self.constraints, self.trajectory)

    def start(self, count: int) -> Tensor:
        """Random trajectories, (count, 7, 6, 2) [rad/s]; the same each time."""
        return self.problem.start(count, torch.Generator().manual_seed(0))

    def untrained(self) -> TrajectoryGenerator:
        """A generator of the default size that yields the Gaussian of random trajectories."""
        seeds = self.start(200)
        scaling = Scaling.fit(seeds)
        network = Generator(*self.trajectory.shape[:2], shortcut=True)
        network.start_from(scaling.image(seeds))
        arm = self.arm
        return TrajectoryGenerator(
            network.eval(), scaling, self.trajectory, arm.name, arm.digest, "untrained"
        )
