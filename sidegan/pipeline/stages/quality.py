"""Stage quality: what generated trajectories add to their seeds, by the best sets of each."""

import math
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pandas as pd
import torch
from torch import Tensor

from sidegan.base.storage import write_parquet
from sidegan.design.criteria import Criteria, criteria_of, variance
from sidegan.design.information import Information, information_of
from sidegan.design.optimal import a_optimal, d_optimal
from sidegan.pipeline.columns import columns
from sidegan.pipeline.graph import Artifact, Build, Metrics
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.library import library
from sidegan.pipeline.stages.random import random_valid
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.training import generators
from sidegan.pipeline.task import FACTS, Task
from sidegan.report.tables import arrow


class _Best(NamedTuple):
    """The best sets from one pool."""

    chosen: Tensor  # indices of the D-optimal set
    worth: Criteria  # of that set
    precision: float  # minus the log of the variance of predicted torques, of the set picked for it


def added(task: Task, name: str) -> Artifact:
    """What every generator of a column adds to its seeds, a row per variant and training.

    Columns of the table: ``generated`` (how many of the D-optimal set from both are), ``condition_seeds`` and
    ``condition_both`` (of the D-optimal sets), ``information`` (geometric mean of the gain over the
    parameters: 1 where nothing is added), ``error`` (expected error of predicted torques, closed form, as a
    share of that of the best set of seeds).
    """
    column = columns(task)[name]
    inputs = {f"{label} {k}": library(column, label, k) for label, k in generators(column)}
    settings = {"count": task.cfg.selection.count, "tests": task.cfg.scale.tests}
    return task.artifact(
        "added",
        name,
        partial(_make, name=name),
        settings,
        {"seeds": seed_set(column), **inputs},
        title=f"added/{name}",
        metrics=_metrics,
    )


def _metrics(folder: Path) -> Metrics:
    """Means over trainings."""
    facts = pd.read_parquet(folder / FACTS)
    return {key: float(facts[key].mean()) for key in ("generated", "information", "error")}


def _make(task: Task, build: Build, name: str) -> None:
    column, count = columns(task)[name], task.cfg.selection.count
    tests = random_valid(column, task.cfg.scale.tests, "tests").coefficients
    target = information_of(column.body, column.trajectory, tests).mean
    seeds = _information(column, seed_set(column))
    least, alone = seeds.prior(), _best(seeds, count, seeds.prior(), target)
    rows, trained = [], generators(column)
    for done, (label, training) in enumerate(trained):
        build.report(done, len(trained))
        made = _information(column, library(column, label, training))
        both = _best(Information(torch.cat([seeds.packed, made.packed])), count, least, target)
        row = {
            "name": label,
            "training": training,
            "generated": int((both.chosen >= len(seeds)).sum()),
            "condition_seeds": alone.worth.condition,
            "condition_both": both.worth.condition,
            "information": math.exp((both.worth.log_det - alone.worth.log_det) / seeds.size),
            "error": math.exp((alone.precision - both.precision) / 2),
        }
        rows.append(row)
    write_parquet(build.folder / FACTS, arrow(pd.DataFrame(rows)))


def _information(task: Task, artifact: Artifact) -> Information:
    """Of each trajectory in an artifact."""
    return information_of(task.body, task.trajectory, task.load(artifact).coefficients)


def _best(pool: Information, count: int, prior: Tensor, target: Tensor) -> _Best:
    """Of ``count`` trajectories; each measure by the pick that is made for it."""
    chosen = d_optimal(pool, count, prior)
    predicting = pool.stacked(a_optimal(pool, count, prior, target))
    return _Best(chosen, criteria_of(pool.stacked(chosen)), float(variance(target).value(predicting[None])))


STAGE = Stage(lambda task: [added(task, name) for name in columns(task)])
