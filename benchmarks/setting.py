"""What the benchmarks run on: the LWR on its desk, at the paper's trajectories."""

from dataclasses import dataclass, field
from functools import cached_property

import torch
from torch import Tensor

from sidegan.design.problem import Problem
from sidegan.gan.variants import Variant
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm, load_robot
from sidegan.validity import Constraints, Plane

_QUICK = 10  # times smaller


@dataclass(frozen=True)
class Setting:
    """Arm, workspace and sizes.

    Attributes:
        quick: a tenth of the work: whether everything runs, not how fast it is.
        repeats: timed runs of each benchmark.
        seeds: how many seeds are optimised.
    """

    quick: bool = False
    repeats: int = 5
    seeds: int = 50
    trajectory: Trajectory = field(default_factory=lambda: Trajectory(7))

    def size(self, full: int) -> int:
        """The number itself, or a tenth of it in quick mode."""
        return max(1, full // _QUICK) if self.quick else full

    @cached_property
    def arm(self) -> Arm:
        """The KUKA LWR IV."""
        return load_robot("kuka_lwr4")

    @cached_property
    def constraints(self) -> Constraints:
        """The arm 10 cm above its desk."""
        return Constraints(self.arm, [Plane((0.0, 0.0, 1.0), 0.10)])

    def variants(self) -> dict[str, Variant]:
        """The SIDE-GAN variants of the paper's first experiment, with its schedule."""
        from hydra import compose, initialize_config_dir

        from sidegan.pipeline import callbacks  # noqa: F401 - registers what the paths in conf/ use
        from sidegan.pipeline.config import validate
        from sidegan.pipeline.run import CONF

        with initialize_config_dir(str(CONF), version_base="1.3"):
            cfg = validate(compose("config", overrides=["+experiment=exp1", "scale=paper"]))
        return cfg.gan

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
