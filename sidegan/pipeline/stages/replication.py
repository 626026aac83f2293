"""Stage replication: identify from whole sets with noise on everything, and from the seeds measured again."""

from functools import partial
from pathlib import Path

import pandas as pd

from sidegan.base.parallel import Report
from sidegan.base.storage import read_torch, write_parquet, write_torch
from sidegan.errors import ArtifactError
from sidegan.identification.study import combined, measured_sums
from sidegan.identification.sums import Sums
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import FACTS, RESULTS, SEEDS, SUMS, Task, study_settings
from sidegan.pipeline.stages.common import load, produce_all
from sidegan.pipeline.stages.random import random_valid
from sidegan.pipeline.tracking import Tracker
from sidegan.report.tables import arrow


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Measure the seeds and every library, then identify from each combination."""
    task = Task(cfg, store)
    wanted = task.measured_sets()
    stamps = [task.sums(*one) for one in wanted]
    produce_all(task, "measurements (%)", stamps, [partial(_measure, task, *one) for one in wanted])
    folder = store.produce(task.replication, partial(_combine, task))
    frame = pd.read_parquet(folder / RESULTS)
    mean = frame[~frame.weighted].groupby(["set", "training"], as_index=False).nmse.mean()
    tracker.log_metrics(
        {f"nmse/whole {task.named(n, k)}": value for n, k, value in mean.itertuples(index=False)}
    )


def _measure(task: Task, name: str, training: int, folder: Path, work: Path, report: Report) -> None:
    """Sums of every noise draw; the seeds are measured as often as they are replicated."""
    wanted = task.cfg.replication
    library = load(task, task.seeds if name == SEEDS else task.library(name, training))
    replicas = max(wanted.replicas) if name == SEEDS else 1
    settings = study_settings(task.cfg.identification, wanted.noise)
    total = wanted.repeats * replicas
    for repeat in range(wanted.repeats):
        for replica in range(replicas):
            path, done = work / f"{repeat}-{replica}.pt", repeat * replicas + replica
            if not _readable(path):
                random = task.random(f"measured {name} {repeat} {replica}", training)
                family = task.trajectory, library.coefficients
                told = partial(_told, report, done, total)
                sums = measured_sums(task.body, family, settings, random, told)
                write_torch(path, sums._asdict())
            report(done + 1, total)
    parts = {(r, k): read_torch(work / f"{r}-{k}.pt") for r in range(wanted.repeats) for k in range(replicas)}
    write_torch(folder / SUMS, [[parts[r, k] for k in range(replicas)] for r in range(wanted.repeats)])


def _told(report: Report, before: int, total: int, done: int, count: int) -> None:
    report(before * count + done, total * count)


def _combine(task: Task, folder: Path, work: Path) -> None:
    wanted, trainings = task.cfg.replication, task.cfg.trainings
    settings = study_settings(task.cfg.identification, wanted.noise)
    tests = (task.trajectory, random_valid(task, task.cfg.identification.tests, "tests")[0])
    seeds = _sums(task, SEEDS, 0)
    tables: list[tuple[pd.DataFrame, pd.DataFrame]] = []
    for repeat in range(wanted.repeats):
        replicated = {f"{SEEDS} ×{k}": seeds[repeat][:k] for k in wanted.replicas}
        jobs = [(0, replicated)]
        for training in trainings:
            grown = {n: [seeds[repeat][0], *_sums(task, n, training)[repeat]] for n in task.cfg.gan}
            jobs.append((training, grown))
        for training, sets in jobs:
            frames = combined(task.body, sets, tests, settings)
            tables.append(tuple(f.assign(training=training, repeat=repeat) for f in frames))  # type: ignore[arg-type]
    for file, part in zip((RESULTS, FACTS), zip(*tables)):
        write_parquet(folder / file, arrow(pd.concat(part, ignore_index=True)))


def _sums(task: Task, name: str, training: int) -> list[list[Sums]]:
    stored = read_torch(task.store.require(task.sums(name, training)) / SUMS)
    return [[Sums(**part) for part in draw] for draw in stored]


def _readable(path: Path) -> bool:
    try:
        read_torch(path)
    except ArtifactError:
        return False
    return True
