"""Stage elsewhere: models of each excitation set, tested on motions that are unlike those in it."""

from dataclasses import asdict
from pathlib import Path

import pandas as pd
import torch
from torch import Tensor

from sidegan.base.storage import write_parquet
from sidegan.identification import Measurements, measure, study
from sidegan.motion.moves import pick_and_place
from sidegan.motion.trajectory import Motion
from sidegan.pipeline.graph import Artifact, Build, Metrics
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.random import REACH, random_valid
from sidegan.pipeline.stages.selection import excitation_sets
from sidegan.pipeline.task import RESULTS, Task
from sidegan.report.tables import arrow

RANDOM, SLOW, FAST, MOVES = "random", "slow", "fast", "pick and place"


def elsewhere(task: Task) -> Artifact:
    """What every set's model is worth on each kind of test."""
    settings = {"identification": asdict(task.cfg.identification), **asdict(task.cfg.elsewhere)}
    inputs = {one.title: one.source for one in excitation_sets(task)}
    label = "-".join(task.cfg.gan)
    return task.artifact("elsewhere", label, _make, settings, inputs, metrics=_mean_errors)


def kinds_of_test(task: Task) -> dict[str, list[Measurements]]:
    """Exact measurements of each kind of test: first the one that Table I has, then those unlike it."""
    settings, count = task.cfg.elsewhere, task.cfg.identification.tests
    kinds = {
        RANDOM: random_valid(task, count, "tests").coefficients,
        SLOW: random_valid(task, count, "slow tests", settings.slow * REACH).coefficients,
        FAST: random_valid(task, count, "fast tests", settings.fast).coefficients,
    }
    times = task.trajectory.times(task.cfg.identification.rate)
    tests = {
        kind: [measure(task.body, task.trajectory.roll_out(one[None], times)) for one in c]
        for kind, c in kinds.items()
    }
    return tests | {MOVES: [measure(task.body, moves(task, kinds[RANDOM], k)) for k in range(count)]}


def moves(task: Task, c: Tensor, number: int) -> Motion:
    """One recording of pick and place between configurations that trajectories (B, J, H, 2) pass.

    The configurations are valid; on the straight way between two of them, which no robot has to go here,
    only the velocity is limited.
    """
    settings = task.cfg.elsewhere
    random = torch.Generator().manual_seed(task.number(f"moves {number}"))
    chosen = torch.randint(len(c), (settings.moves + 1,), generator=random)
    times = task.trajectory.period * torch.rand(settings.moves + 1, generator=random, dtype=torch.float64)
    points = [
        task.trajectory.derivative(c[k, None], t[None], 0)[0, 0] for k, t in zip(chosen.tolist(), times)
    ]
    limit = settings.velocity * task.arm.velocity_limit
    return pick_and_place(torch.stack(points), limit, settings.rest, task.cfg.identification.rate)


def _mean_errors(folder: Path) -> Metrics:
    """Mean nMSE and share over sets, joints and noise draws, unweighted, by kind of test."""
    frame = pd.read_parquet(folder / RESULTS)
    mean = frame[~frame.weighted].groupby("test")[["nmse", "share"]].mean()
    return {f"{kind} {key}": float(x) for key, column in mean.items() for kind, x in column.items()}


def _make(task: Task, build: Build) -> None:
    tests, sets, tables = kinds_of_test(task), excitation_sets(task), []
    for done, one in enumerate(sets, start=1):
        family = one.family, task.load(one.source).coefficients
        random = task.random("identification")
        errors = study.errors_on(task.body, family, tests, task.cfg.identification, random)
        tables.append(errors.assign(set=one.name, training=one.training or 0))
        build.report(done, len(sets))
    write_parquet(build.folder / RESULTS, arrow(pd.concat(tables, ignore_index=True)))


STAGE = Stage(lambda task: [elsewhere(task)], columnwise=True, leading=True)
