"""Stage sensitivity: the excitation sets compared again, with one setting changed at a time."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import pandas as pd
import torch

from sidegan.base.parallel import Job, Report, run_jobs
from sidegan.base.storage import read_torch, readable, write_parquet, write_task
from sidegan.design.greedy import greedy
from sidegan.identification import StudySettings, study
from sidegan.library import Library
from sidegan.pipeline.graph import Artifact, Build
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.kinds import kind
from sidegan.pipeline.stages.pools import SEEDS, Pool, pools
from sidegan.pipeline.stages.random import random_valid
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.task import RESULTS, Task
from sidegan.report.tables import arrow

_DIAGONAL = "diagonal"  # kind of seeds optimised for the other fitness


@dataclass(frozen=True)
class Alternative:
    """One change of the comparison: which factor, to what, and the settings and set size that follow."""

    factor: str
    value: str
    settings: StudySettings
    count: int


def sensitivity(task: Task) -> Artifact:
    """The comparison repeated with every alternative."""
    settings = {**asdict(task.cfg.identification), **asdict(task.cfg.sensitivity)}
    settings["count"] = task.cfg.selection.count
    inputs = {f"{one.title} {part.maker}": part for one in compared(task) for part in one.parts}
    label = "-".join(task.cfg.gan)
    return task.artifact("sensitivity", label, _make, settings, inputs, alone=True)


def alternatives(task: Task) -> Iterator[Alternative]:
    """Every change, one at a time, the unchanged comparison first."""
    changes, count = task.cfg.sensitivity, task.cfg.selection.count
    usual = replace(task.cfg.identification, repeats=changes.repeats)
    yield Alternative("none", "as in experiment 1", usual, count)
    for name, noise in changes.noises.items():
        yield Alternative("noise", name, replace(usual, noise=noise), count)
    for prior in changes.priors:
        yield Alternative("prior", f"{prior:g}", replace(usual, prior=prior), count)
    for number in changes.counts:
        yield Alternative("count", str(number), usual, number)


def compared(task: Task) -> list[Pool]:
    """Every pool that sets are picked from; seeds of both fitnesses where there are any of the other."""
    if _DIAGONAL not in task.cfg.kinds:
        return pools(task)
    diagonal = Pool("seeds, diagonal", None, "seeds, diagonal", (kind(task, _DIAGONAL),))
    eigenvalue = Pool("seeds, eigenvalue", None, "seeds, eigenvalue", (seed_set(task),))
    return [*pools(task), eigenvalue, diagonal]


def _make(task: Task, build: Build) -> None:
    options = [(change, pool) for change in alternatives(task) for pool in compared(task)]
    jobs: list[Job] = [partial(_compare, task, *one, build.work / f"{i}.pt") for i, one in enumerate(options)]
    frames = run_jobs("sensitivity (%)", jobs, task.cfg.parallel.workers)
    results = [frame for frame in frames if frame is not None]
    write_parquet(build.folder / RESULTS, arrow(pd.concat(results, ignore_index=True)))


def _compare(task: Task, change: Alternative, pool: Pool, path: Path, report: Report) -> pd.DataFrame | None:
    """The comparison of one pool; None where it holds fewer trajectories than are picked."""
    library = _trajectories(task, pool)
    if len(library) < change.count:
        report(1, 1)
        return None
    if not readable(path):
        chosen = library.take(greedy(library.diagonal, change.count)).coefficients
        tests = (task.trajectory, random_valid(task, task.cfg.identification.tests, "tests").coefficients)
        sets = {pool.name: (task.trajectory, chosen)}
        frames = study.compare(task.body, sets, tests, change.settings, task.random("sensitivity"), report)
        both = frames[0].merge(frames[1], on=["set", "repeat"])
        both = both.assign(factor=change.factor, value=change.value, training=pool.training or 0)
        write_task(path, both.to_dict("list"))
    return pd.DataFrame(read_torch(path))


def _trajectories(task: Task, pool: Pool) -> Library:
    library = pool.load(task)
    if pool.name != f"{SEEDS}, eigenvalue":
        return library
    return library.take(
        torch.arange(min(len(library), task.cfg.kinds[_DIAGONAL].count))
    )  # as many as the others


STAGE = Stage(lambda task: [sensitivity(task)])
