"""Stage long: the single long trajectory in each of its readings."""

from dataclasses import asdict
from functools import partial

from sidegan.base.storage import write_json
from sidegan.design.problem import Problem
from sidegan.library.measure import measured
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.graph import Artifact, Build
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.task import LIBRARY, REPORT, Task
from sidegan.seeds import make_long


def long_family(task: Task, harmonics: int) -> Trajectory:
    """The family of a single long trajectory."""
    return Trajectory(task.arm.joints, harmonics, task.cfg.long.period, task.trajectory.home)


def long_trajectory(task: Task, harmonics: int) -> Artifact:
    """The best single long trajectory with so many harmonics."""
    settings = task.cfg.long
    return task.artifact(
        "long",
        f"{settings.period:g}s-{harmonics}h",
        partial(_make, harmonics=harmonics),
        {**asdict(settings), "harmonics": harmonics},
        title=f"long/{harmonics}",
    )


def _make(task: Task, build: Build, harmonics: int) -> None:
    settings, family = task.cfg.long, long_family(task, harmonics)
    problem = Problem(task.constraints, family, settings.samples)
    random = task.random(f"long {harmonics}")
    made = make_long(problem, settings.steps, settings.starts, random, build.report)
    library = measured(task.constraints, family, made.coefficients, f"long-{harmonics}")
    library.save(build.folder / LIBRARY)
    build.costs["cpu_seconds"] = made.cpu_seconds
    write_json(build.folder / REPORT, {"condition": float(library.fitness[0]), "starts": made.attempts})


STAGE = Stage(lambda task: [long_trajectory(task, h) for h in task.cfg.long.harmonics], columnwise=True)
