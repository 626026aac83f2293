"""Stage long: the single long trajectory in each of its readings."""

from dataclasses import asdict, replace
from functools import partial

from sidegan.base.storage import write_json
from sidegan.library.measure import measured
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.graph import Artifact, Build
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.task import LIBRARY, REPORT, Task
from sidegan.seeds import Seeds, make_long

_OF_A_SET = {"count", "samples", "batch", "attempts"}  # settings of the seeds that are not of the optimiser


def long_family(task: Task, harmonics: int) -> Trajectory:
    """The family of a single long trajectory."""
    return Trajectory(task.arm.joints, harmonics, task.cfg.long.period, task.trajectory.home)


def long_trajectory(task: Task, harmonics: int) -> Artifact:
    """The best single long trajectory with so many harmonics, by the optimiser of the seeds."""
    settings, seeds = task.cfg.long, _as_seeds(task)
    optimiser = {key: x for key, x in seeds.stamped().items() if key not in _OF_A_SET}
    return task.artifact(
        "long",
        f"{seeds.method}{seeds.steps}-{settings.period:g}s-{harmonics}h",
        partial(_make, harmonics=harmonics),
        {**asdict(settings), "harmonics": harmonics, "optimiser": optimiser},
        title=f"long/{harmonics}",
    )


def _as_seeds(task: Task) -> Seeds:
    """The settings of the seeds, for a long trajectory."""
    settings, seeds = task.cfg.long, task.cfg.seeds
    return replace(seeds, samples=settings.samples, steps=settings.steps or seeds.steps)


def _make(task: Task, build: Build, harmonics: int) -> None:
    settings, family, seeds = task.cfg.long, long_family(task, harmonics), _as_seeds(task)
    problem, random = seeds.problem(task.constraints, family), task.random(f"long {harmonics}")
    made = make_long(problem, seeds.single, settings.starts, random, build.report)
    library = measured(task.constraints, family, made.coefficients, f"long-{harmonics}")
    library.save(build.folder / LIBRARY)
    build.costs["cpu_seconds"] = made.cpu_seconds
    report = {"condition": float(library.fitness[0]), "starts": made.attempts}
    write_json(build.folder / REPORT, report | {"evaluations": seeds.evaluations_per_start})


STAGE = Stage(lambda task: [long_trajectory(task, h) for h in task.cfg.long.harmonics])
