"""Stage replication: identification from whole sets with noise on everything, the seeds measured again."""

from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

import pandas as pd

from sidegan.base.parallel import Report
from sidegan.base.storage import read_torch, readable, write_parquet, write_torch
from sidegan.identification import StudySettings
from sidegan.identification.study import combined, measured_sums
from sidegan.identification.sums import Sums
from sidegan.pipeline.graph import Artifact, Build, Metrics
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.pools import SEEDS, Pool, own_pools
from sidegan.pipeline.stages.random import random_valid
from sidegan.pipeline.stages.training import title
from sidegan.pipeline.task import FACTS, RESULTS, Task
from sidegan.report.tables import arrow

SUMS = "sums.pt"


def whole_sets(task: Task) -> list[Pool]:
    """Every whole set that is measured: the seeds and each library."""
    return own_pools(task)[1:]


def sums(task: Task, pool: Pool) -> Artifact:
    """The sums of the noisy measurements of a whole set."""
    settings = asdict(task.cfg.replication) | {"rate": task.cfg.identification.rate}
    settings["replicas"] = _replicas(task, pool)
    make = partial(_measure, pool=pool)
    return task.artifact("sums", pool.name, make, settings, pool.inputs, training=pool.training)


def replication(task: Task) -> Artifact:
    """What identification from each combination of whole sets is worth."""
    inputs = {f"{one.name} {one.training or 0}": sums(task, one) for one in whole_sets(task)}
    settings = asdict(task.cfg.identification) | asdict(task.cfg.replication)
    metrics = partial(_mean_errors, task)
    return task.artifact(
        "replication", "-".join(task.cfg.gan), _combine, settings, inputs, title="nmse", metrics=metrics
    )


def _replicas(task: Task, pool: Pool) -> int:
    """How often a set is measured; the seeds as often as they are replicated."""
    return max(task.cfg.replication.replicas) if pool.name == SEEDS else 1


def _mean_errors(task: Task, folder: Path) -> Metrics:
    frame = pd.read_parquet(folder / RESULTS)
    mean = frame[~frame.weighted].groupby(["set", "training"], as_index=False).nmse.mean()
    return {
        f"whole {title(task, n, k if n in task.cfg.gan else None)}": x
        for n, k, x in mean.itertuples(index=False)
    }


def _measure(task: Task, build: Build, pool: Pool) -> None:
    """Sums of every noise draw; the seeds are measured as often as they are replicated."""
    settings, replicas, library = task.cfg.replication, _replicas(task, pool), pool.load(task)
    parts = {(r, k): build.work / f"{r}-{k}.pt" for r in range(settings.repeats) for k in range(replicas)}
    for done, ((repeat, replica), path) in enumerate(parts.items()):
        if not readable(path):
            random = task.random(f"measured {pool.name} {repeat} {replica}", pool.training)
            family = (task.trajectory, library.coefficients)
            report = partial(_report_part, build.report, done, len(parts))
            write_torch(path, measured_sums(task.body, family, _study(task), random, report)._asdict())
        build.report(done + 1, len(parts))
    draws = [[read_torch(parts[r, k]) for k in range(replicas)] for r in range(settings.repeats)]
    write_torch(build.folder / SUMS, draws)


def _study(task: Task) -> StudySettings:
    """The comparison's settings with the noise of whole sets."""
    return replace(task.cfg.identification, noise=task.cfg.replication.noise)


def _report_part(report: Report, before: int, total: int, done: int, count: int) -> None:
    report(before * count + done, total * count)


def _combine(task: Task, build: Build) -> None:
    settings = task.cfg.replication
    tests = (task.trajectory, random_valid(task, task.cfg.identification.tests, "tests").coefficients)
    seeds, *libraries = ((one, _sums(task, one)) for one in whole_sets(task))
    tables: list[tuple[pd.DataFrame, ...]] = []
    for repeat in range(settings.repeats):
        first = seeds[1][repeat]
        jobs = [(0, {f"{SEEDS} ×{k}": first[:k] for k in settings.replicas})]
        for training in task.cfg.trainings:
            of_training = [(pool, draws) for pool, draws in libraries if pool.training == training]
            jobs.append((training, {pool.name: [first[0], *draws[repeat]] for pool, draws in of_training}))
        for training, sets in jobs:
            frames = combined(task.body, sets, tests, _study(task))
            tables.append(tuple(one.assign(training=training, repeat=repeat) for one in frames))
    for file, part in zip((RESULTS, FACTS), zip(*tables)):
        write_parquet(build.folder / file, arrow(pd.concat(part, ignore_index=True)))


def _sums(task: Task, pool: Pool) -> list[list[Sums]]:
    draws = read_torch(task.store.require(sums(task, pool)) / SUMS)
    return [[Sums(**part) for part in draw] for draw in draws]


STAGE = Stage(
    lambda task: [*(sums(task, one) for one in whole_sets(task)), replication(task)], columnwise=True
)
