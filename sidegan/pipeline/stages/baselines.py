"""Stages random and long: baselines, valid trajectories that nobody optimised, and a single long one."""

from dataclasses import asdict
from functools import partial

import torch
from torch import Tensor

from sidegan.base.storage import write_json
from sidegan.design.problem import Problem
from sidegan.library.draw import Draws, Expansion, draw_valid
from sidegan.library.measure import measured, summary
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.artifact import Artifact, Build
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.task import LIBRARY, REPORT, Task
from sidegan.seeds import Gradient, make_long

REACH = 0.8  # of the tightest joint limit, that a random trajectory uses
_TRIES = 1000  # draws for each random trajectory, most of them


def random_set(task: Task) -> Artifact:
    """Random valid trajectories, as many as a generator's library has."""
    settings = {"count": task.cfg.library.count}
    return task.artifact("random", "random", _make_random, settings, title="random", alone=True)


def random_valid(task: Task, count: int, purpose: str, reach: float = REACH) -> Draws:
    """Random valid trajectories, (count, J, H, 2), of the task's own draws for a purpose."""
    generator = torch.Generator().manual_seed(task.number(purpose))
    settings = Expansion(count, batch=count, draws=_TRIES * count, least=count)
    return draw_valid(
        lambda n: task.problem.start(n, generator, reach),
        task.check,
        settings,
        "drawn at random in this workspace",
    )


def test_trajectories(task: Task) -> Tensor:
    """Trajectories whose torques are predicted, (tests, J, H, 2); no set contains or generated them."""
    settings = task.cfg.identification
    return random_valid(task, settings.tests, "tests", settings.reach).coefficients


def _make_random(task: Task, build: Build) -> None:
    count = task.cfg.library.count
    draws = random_valid(task, count, "random set")
    library = measured(task.constraints, task.trajectory, draws.coefficients, "random")
    library.save(build.folder / LIBRARY)
    share = {"drawn": draws.drawn, "valid_share": count / draws.drawn}
    write_json(build.folder / REPORT, {**summary(library), **share})


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
        partial(_make_long, harmonics=harmonics),
        {**asdict(settings), "harmonics": harmonics, **seeds},
        title=f"long/{harmonics}",
    )


def _make_long(task: Task, build: Build, harmonics: int) -> None:
    settings, family, seeds = task.cfg.long, long_family(task, harmonics), task.cfg.seeds
    problem = Problem(task.constraints, family, settings.samples, diagonal=seeds.fitness == "diagonal")
    method = Gradient(settings.steps, attempts=1, reserve=seeds.reserve or 0.0)
    made = make_long(problem, method, settings.starts, task.random(f"long {harmonics}"), build.report)
    library = measured(task.constraints, family, made.coefficients, f"long-{harmonics}")
    library.save(build.folder / LIBRARY)
    build.costs["cpu_seconds"] = made.cpu_seconds
    report = {"condition": float(library.fitness[0]), "starts": made.attempts}
    write_json(build.folder / REPORT, report | {"evaluations": settings.steps})


STAGES = {
    "random": Stage(lambda task: [random_set(task)]),
    "long": Stage(lambda task: [long_trajectory(task, h) for h in task.cfg.long.harmonics]),
}
