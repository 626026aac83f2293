"""A set of trajectories, executed one by one in worker processes."""

from collections.abc import Callable
from functools import partial
from typing import TypeVar

import numpy as np
from torch import Tensor

from sidegan.base.parallel import Job, Report, run_jobs
from sidegan.motion.trajectory import Trajectory
from sidegan.plant.execute import Executed, Plant
from sidegan.plant.settings import PlantSettings
from sidegan.robot import Arm

T = TypeVar("T")


def execute_all(
    arm: Arm,
    settings: PlantSettings,
    trajectory: Trajectory,
    coefficients: Tensor,
    random: np.random.SeedSequence,
    condition: Callable[[Executed], T],
    workers: int | None = None,
) -> list[T]:
    """What ``condition`` makes of the recording of each trajectory, in their order.

    A recording at 1 kHz is large: it is conditioned in the process that executed it.

    Args:
        arm: the arm.
        settings: of the plant.
        trajectory: the family.
        coefficients: [rad/s], (n, J, H, 2).
        random: of the sensors' noise; each trajectory draws its own.
        condition: picklable; takes a recording, gives what is wanted of it.
        workers: processes; None: one per core.

    Raises:
        InfeasibleError: when a joint does not follow a trajectory.
        RobotError: when a link is not physically consistent.
        ConfigError: when the settings do not fit the arm.
        ShapeError: when the coefficients do not fit the trajectory or the arm.
    """
    trajectory.check(coefficients)
    settings.check(arm.joints)
    jobs: list[Job] = [
        partial(_execute, arm, settings, trajectory, c, child, condition)
        for c, child in zip(coefficients, random.spawn(len(coefficients)))
    ]
    return run_jobs("executing in MuJoCo", jobs, workers)


def _execute(
    arm: Arm,
    settings: PlantSettings,
    trajectory: Trajectory,
    c: Tensor,
    random: np.random.SeedSequence,
    condition: Callable[[Executed], T],
    report: Report,
) -> T:
    motion = trajectory.roll_out(c[None], trajectory.times(settings.rate))
    result = condition(Plant(arm, settings).execute(motion, random))
    report(1, 1)
    return result
