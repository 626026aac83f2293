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
from sidegan.seeds import Gradient, make_long


def long_family(task: Task, harmonics: int) -> Trajectory:
    """The family of a single long trajectory."""
    return Trajectory(task.arm.joints, harmonics, task.cfg.long.period, task.trajectory.home)


def long_trajectory(task: Task, harmonics: int) -> Artifact:
    """The best single long trajectory with so many harmonics, by gradients."""
    settings = task.cfg.long
    seeds = {"fitness": task.cfg.seeds.fitness, "reserve": task.cfg.seeds.reserve}
    return task.artifact(
        "long",
        f"{settings.steps}-{settings.period:g}s-{harmonics}h",
        partial(_make, harmonics=harmonics),
        {**asdict(settings), "harmonics": harmonics, **seeds},
        title=f"long/{harmonics}",
    )


def _make(task: Task, build: Build, harmonics: int) -> None:
    settings, family, seeds = task.cfg.long, long_family(task, harmonics), task.cfg.seeds
    problem = Problem(task.constraints, family, settings.samples, diagonal=seeds.fitness == "diagonal")
    method = Gradient(settings.steps, attempts=1, reserve=seeds.reserve or 0.0)
    made = make_long(problem, method, settings.starts, task.random(f"long {harmonics}"), build.report)
    library = measured(task.constraints, family, made.coefficients, f"long-{harmonics}")
    library.save(build.folder / LIBRARY)
    build.costs["cpu_seconds"] = made.cpu_seconds
    report = {"condition": float(library.fitness[0]), "starts": made.attempts}
    write_json(build.folder / REPORT, report | {"evaluations": settings.steps})


STAGE = Stage(lambda task: [long_trajectory(task, h) for h in task.cfg.long.harmonics])
