"""Stage readings: Table II under other readings of its noise, Table III under other recursions."""

from collections.abc import Iterator
from dataclasses import asdict
from functools import reduce

import pandas as pd
import torch

from sidegan.base.storage import write_parquet
from sidegan.identification import study
from sidegan.identification.study import Family
from sidegan.identification.sums import Sums
from sidegan.pipeline.graph import Artifact, Build
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.pools import SEEDS
from sidegan.pipeline.stages.replication import draws, replication, study_settings, sums, whole_sets
from sidegan.pipeline.task import RESULTS, Task
from sidegan.report.tables import arrow

Executed = tuple[str, int, Family, Sums]  # set, training, trajectories in order, sums over their samples


def readings(task: Task) -> dict[str, Task]:
    """The task under each reading of the noise on whole sets, by name, its own first."""
    own, given = task.cfg.replication, task.cfg.readings
    others = {name: task.with_settings(replication=one, readings={}) for name, one in given.items()}
    return {own.reading: task} | others


def covariance(task: Task) -> Artifact:
    """Covariance norms of the whole sets under each recursion."""
    settings = {
        "rate": task.cfg.identification.rate,
        "replicas": task.cfg.replication.replicas,
        "recursions": [asdict(one) for one in task.cfg.recursions],
    }
    inputs: dict[str, Artifact | str] = {}
    for pool in whole_sets(task):
        key = f"{pool.name} {pool.training or 0}"
        inputs |= {f"{key} {one.maker}": one for one in (*pool.parts, sums(task, pool))}
    return task.artifact("covariance", "-".join(task.cfg.gan), _make, settings, inputs)


def _make(task: Task, build: Build) -> None:
    recursions, rows = task.cfg.recursions, []
    settings = study_settings(task, task.cfg.replication.noise)
    count = len(task.cfg.replication.replicas) + len(whole_sets(task)) - 1
    for done, (name, training, family, whole) in enumerate(_executed(task), start=1):
        random = task.random("recursion")  # the same noise on all: more of the same seeds change nothing else
        norms = study.covariance_norms(task.body, family, whole, recursions, settings, random)
        rows += [(name, training, r.prior, r.forgetting, x) for r, x in zip(recursions, norms)]
        build.report(done, count)
    columns = ["set", "training", "prior", "forgetting", "covariance_norm"]
    write_parquet(build.folder / RESULTS, arrow(pd.DataFrame(rows, columns=columns)))


def _executed(task: Task) -> Iterator[Executed]:
    """Every set of Table III: the seeds so often, and the seeds followed by each library."""
    seeds, *libraries = whole_sets(task)
    once, (first, *_) = seeds.load(task).coefficients, draws(task, seeds)
    for k in task.cfg.replication.replicas:
        again = once.repeat(k, 1, 1, 1)
        yield f"{SEEDS} ×{k}", 0, (task.trajectory, again), reduce(Sums.plus, first[:k])
    for pool in libraries:
        both = torch.cat([once, pool.load(task).coefficients])
        (generated,), *_ = draws(task, pool)
        yield pool.name, pool.training or 0, (task.trajectory, both), first[0].plus(generated)


STAGE = Stage(
    lambda task: [
        *(sums(one, pool) for one in readings(task).values() for pool in whole_sets(one)),
        *map(replication, readings(task).values()),
        covariance(task),
    ],
    columnwise=True,
    leading=True,
)
