"""A stage: artifacts that are made together, recorded, and presented."""

import logging
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from graphlib import TopologicalSorter
from typing import Any

from sidegan.base.names import plain
from sidegan.base.parallel import Job, run_jobs
from sidegan.base.storage import read_json, write_json
from sidegan.pipeline.artifact import Artifact
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.tracking import Tracker

log = logging.getLogger(__name__)

MODELS = {"gan", "identify"}  # makers whose artifacts MLflow lists as models
ARTIFACTS = "artifacts.json"  # in the run's folder


@dataclass(frozen=True)
class Stage:
    """A part of an experiment that can be run alone, once its inputs exist."""

    artifacts: Callable[[RunContext], Iterable[Artifact]] = lambda run: ()  # in the order of recording
    # prints results, and writes them to the run's folder
    show: Callable[[RunContext, Tracker], None] = lambda run, tracker: None
    check: Callable[[RunContext], object] = lambda run: None  # may refuse a run before its first stage


def run_stage(name: str, stage: Stage, run: RunContext, tracker: Tracker) -> None:
    """Make the stage's missing artifacts, and record all of them."""
    artifacts = {artifact.digest: artifact for artifact in stage.artifacts(run)}
    missing = {digest for digest, artifact in artifacts.items() if run.store.find(artifact) is None}
    if missing and run.planning:
        _ = run.cell.constraints  # raises, before anything is written, if the arm cannot rest at home
    order = TopologicalSorter[str]()
    for digest, artifact in artifacts.items():
        parents = {source.digest for source in artifact.inputs.values() if isinstance(source, Artifact)}
        order.add(digest, *(parents & artifacts.keys()))
    order.prepare()
    while ready := order.get_ready():
        _produce(name, run, [artifacts[digest] for digest in ready], missing)
        order.done(*ready)
    for digest, artifact in artifacts.items():
        if digest not in tracker.recorded:  # stages may share artifacts
            tracker.recorded.add(digest)
            _record(artifact, run, tracker)
    if artifacts:  # their folders below the outputs, by title
        path = run.store.run_folder / ARTIFACTS
        known = read_json(path) if path.exists() else {}
        found = {artifact.title: artifact.folder.as_posix() for artifact in artifacts.values()}
        write_json(path, known | found)
    stage.show(run, tracker)


def _produce(name: str, run: RunContext, artifacts: list[Artifact], missing: set[str]) -> None:
    """Make artifacts in parallel, a process each; those that are parallel themselves one by one."""
    jobs: list[Job] = []
    for artifact in artifacts:
        if artifact.alone or artifact.digest not in missing:
            run.store.produce(artifact)
        else:
            jobs.append(partial(run.store.produce, artifact))
    if jobs:
        run_jobs(f"{name} (%)", jobs, run.cfg.parallel.workers)


def _record(artifact: Artifact, run: RunContext, tracker: Tracker) -> None:
    """Log an artifact's metrics and costs, and record it if it is a model."""
    title = artifact.title
    folder = run.store.require(artifact)
    metrics = artifact.metrics(folder)
    costs = run.store.costs(artifact)
    numbers = {key: float(x) for key, x in metrics.items() if isinstance(x, int | float)}
    series = {key: x for key, x in metrics.items() if not isinstance(x, int | float)}
    spent = {key: float(x) for key, x in costs.items() if isinstance(x, int | float)}
    model = tracker.log_model(title, artifact.digest, folder) if artifact.maker in MODELS else None
    # MLflow groups charts by prefix: an artifact's results together, and one kind of cost over all artifacts.
    tracker.log_metrics({f"{title}/{key}": x for key, x in numbers.items()}, model)
    tracker.log_metrics({f"{key}/{title.replace('/', ' ')}": x for key, x in spent.items()})
    tracker.log_history({f"{title}/{key}": x for key, x in series.items()}, model)
    texts = [f"{key} {plain(x, '.4g')}" for key, x in (numbers | spent).items()]
    log.info("%s: %s", title, ", ".join(texts))


def finite(row: Mapping[str, Any]) -> dict[str, Any]:
    """The row with None instead of values that are not finite, for JSON."""
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in row.items()}
