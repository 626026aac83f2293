"""A stage: some artifacts that are made together, recorded, and shown."""

import logging
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from graphlib import TopologicalSorter
from typing import Any

from sidegan.base.names import plain
from sidegan.base.parallel import Job, run_jobs
from sidegan.pipeline.artifact import Artifact
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.tracking import Tracker

log = logging.getLogger(__name__)

MODELS = {"gan", "identify"}  # makers of what MLflow lists as models


@dataclass(frozen=True)
class Stage:
    """A part of an experiment that can be run alone: what it needs must be there already."""

    artifacts: Callable[[RunContext], Iterable[Artifact]] = lambda run: ()  # in the order of their records
    # prints, and fills the run's folder
    show: Callable[[RunContext, Tracker], None] = lambda run, tracker: None
    check: Callable[[RunContext], object] = lambda run: None  # before the first stage begins, refuses it


def run_stage(name: str, stage: Stage, run: RunContext, tracker: Tracker) -> None:
    """Make what is not there, and record all of it."""
    artifacts = {one.digest: one for one in stage.artifacts(run)}
    missing = {digest for digest, one in artifacts.items() if run.store.find(one) is None}
    if missing and run.planning:
        _ = run.cell.constraints  # an arm that cannot rest at home is refused before anything is written
    order = TopologicalSorter({k: one.parents & artifacts.keys() for k, one in artifacts.items()})
    order.prepare()
    while ready := order.get_ready():
        _produce(name, run, [artifacts[digest] for digest in ready], missing)
        order.done(*ready)
    for digest, artifact in artifacts.items():
        if digest not in tracker.recorded:  # by a stage that has made it too
            tracker.recorded.add(digest)
            _record(artifact, run, tracker)
    stage.show(run, tracker)


def _produce(name: str, run: RunContext, artifacts: list[Artifact], missing: set[str]) -> None:
    """Make artifacts side by side, one process each; those that spread their own work one by one."""
    jobs: list[Job] = []
    for artifact in artifacts:
        if artifact.alone or artifact.digest not in missing:
            run.store.produce(artifact)
        else:
            jobs.append(partial(run.store.produce, artifact))
    if jobs:
        run_jobs(f"{name} (%)", jobs, run.cfg.parallel.workers)


def _record(artifact: Artifact, run: RunContext, tracker: Tracker) -> None:
    """Log the metrics of an artifact and the costs of making it, and record it where it is a model."""
    title, folder = artifact.title, run.store.require(artifact)
    metrics, costs = artifact.metrics(folder), run.store.costs(artifact)
    numbers = {key: float(x) for key, x in metrics.items() if isinstance(x, int | float)}
    series = {key: x for key, x in metrics.items() if not isinstance(x, int | float)}
    spent = {key: float(x) for key, x in costs.items() if isinstance(x, int | float)}
    model = tracker.log_model(title, artifact.digest, folder) if artifact.maker in MODELS else None
    # MLflow draws those with one beginning together: results of an artifact, and one kind of costs of all.
    tracker.log_metrics({f"{title}/{key}": x for key, x in numbers.items()}, model)
    tracker.log_metrics({f"{key}/{title.replace('/', ' ')}": x for key, x in spent.items()})
    tracker.log_history({f"{title}/{key}": x for key, x in series.items()}, model)
    last = {key: values[-1] for key, values in series.items() if values}
    epochs = max(map(len, series.values()), default=0)
    when, found = ("", numbers | spent) if numbers or not series else (f" after {epochs} epochs", last)
    said = [f"{k} {plain(x, '.4g')}" if isinstance(x, float) else f"{k} {x}" for k, x in found.items()]
    log.info("%s%s: %s", title, when, ", ".join(said))


def finite(row: Mapping[str, Any]) -> dict[str, Any]:
    """The row with None in place of what is not a finite number, as JSON wants it."""
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in row.items()}
