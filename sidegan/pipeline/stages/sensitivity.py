"""Stage sensitivity: compare the excitation sets again, with one setting changed at a time."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import pandas as pd
import torch

from sidegan.base.parallel import Job, Report, run_jobs
from sidegan.base.storage import read_torch, write_parquet, write_torch
from sidegan.design.greedy import greedy
from sidegan.errors import ArtifactError, SideganError
from sidegan.identification import StudySettings, study
from sidegan.library import Library
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import RANDOM, RESULTS, SEEDS, Task, study_settings
from sidegan.pipeline.stages.common import load
from sidegan.pipeline.stages.random import random_valid
from sidegan.pipeline.tracking import Tracker
from sidegan.report.tables import arrow


@dataclass(frozen=True)
class Alternative:
    """One change of the comparison: which factor, to what, and the settings and set size that follow."""

    factor: str
    value: str
    settings: StudySettings
    count: int


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Compare with every alternative."""
    task = Task(cfg, store)
    store.produce(task.sensitivity, partial(_make, task))


def alternatives(task: Task) -> Iterator[Alternative]:
    """Every change, one at a time, the unchanged comparison first."""
    wanted, count = task.cfg.sensitivity, task.cfg.selection.count
    usual = replace(study_settings(task.cfg.identification), repeats=wanted.repeats)
    yield Alternative("none", "as in experiment 1", usual, count)
    for name, noise in wanted.noises.items():
        yield Alternative("noise", name, replace(usual, noise=noise), count)
    for prior in wanted.priors:
        yield Alternative("prior", f"{prior:g}", replace(usual, prior=prior), count)
    for number in wanted.counts:
        yield Alternative("count", str(number), usual, number)


def pools(task: Task) -> list[tuple[str, int]]:
    """Name and training of every pool that sets are picked from."""
    small = task.cfg.kinds["diagonal"].count if "diagonal" in task.cfg.kinds else 0
    kinds = [("seeds, eigenvalue", 0), ("seeds, diagonal", 0)] if small else []
    return [*task.short_sets(), *kinds]


def _make(task: Task, folder: Path, work: Path) -> None:
    options = [(change, *pool) for change in alternatives(task) for pool in pools(task)]
    jobs: list[Job] = [partial(_compare, task, *one, work / f"{i}.pt") for i, one in enumerate(options)]
    frames = run_jobs("sensitivity (%)", jobs, task.cfg.parallel.workers)
    known = [frame for frame in frames if frame is not None]
    write_parquet(folder / RESULTS, arrow(pd.concat(known, ignore_index=True)))


def _compare(
    task: Task, change: Alternative, name: str, training: int, path: Path, report: Report
) -> pd.DataFrame | None:
    pool = _pool(task, name, training)
    if len(pool) < change.count:
        report(1, 1)
        return None
    try:
        rows = read_torch(path)
    except ArtifactError:
        chosen = pool.take(greedy(pool.diagonal, change.count)).coefficients
        tests = (task.trajectory, random_valid(task, task.cfg.identification.tests, "tests")[0])
        sets = {name: (task.trajectory, chosen)}
        made = study.compare(task.body, sets, tests, change.settings, task.random("sensitivity"), report)
        both = made[0].merge(made[1], on=["set", "repeat"])
        both = both.assign(factor=change.factor, value=change.value, training=training)
        rows = both.to_dict("list")
        write_torch(path, rows)
    return pd.DataFrame(rows)


def _pool(task: Task, name: str, training: int) -> Library:
    if name == RANDOM:
        return load(task, task.random_set)
    if name == "seeds, diagonal":
        return load(task, task.kind("diagonal").seeds)
    seeds = load(task, task.seeds)
    if name == SEEDS:
        return seeds
    if name == "seeds, eigenvalue":  # as many as there are of the other kind
        return seeds.take(torch.arange(min(len(seeds), task.cfg.kinds["diagonal"].count)))
    if name not in task.cfg.gan:
        raise SideganError(f"there is no pool {name!r}")
    return seeds.merge(load(task, task.library(name, training)))
