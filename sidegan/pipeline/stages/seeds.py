"""Stage seeds: the seed set, by the configured optimiser, or a published one."""

import logging
from typing import Any

import torch

from sidegan.base.extras import require
from sidegan.base.storage import write_json, write_torch
from sidegan.errors import InfeasibleError
from sidegan.library.measure import measured, summary
from sidegan.pipeline.artifact import Artifact, Build
from sidegan.pipeline.compose import CONF
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.task import LIBRARY, REPORT, Task
from sidegan.seeds import Tasks, make_seeds
from sidegan.seeds.result import SeedBatch
from sidegan.seeds.shipped import shipped
from sidegan.validity import summarise_faults

FEATURES = "features.pt"  # the authors' own of their seeds
log = logging.getLogger(__name__)


def seed_set(task: Task) -> Artifact:
    """The seed set; each method is a maker of its own."""
    settings = task.cfg.seeds
    maker = "seeds" if settings.method == "gradient" else f"{settings.method}_seeds"
    label = settings.method if settings.fitness == "eigenvalue" else f"{settings.method}-{settings.fitness}"
    make = _read if settings.method == "published" else _make
    return task.artifact(maker, label, make, settings.stamped(), title="seeds", alone=True)


def origin(task: Task) -> dict[str, Any]:
    """Settings that make a set, but for its size: the first seeds of a larger set are a smaller one."""
    params = seed_set(task).params
    settings = params["settings"]["paper_seeds"]
    kept = {name: x for name, x in settings.items() if name != "count"}
    return {**params, "settings": {**params["settings"], "paper_seeds": kept}}


def _read(task: Task, build: Build) -> None:
    """The valid ones of published seeds."""
    published = task.cfg.seeds.published.read(task.trajectory)[: task.cfg.seeds.count]
    every = measured(task.constraints, task.trajectory, published, task.cfg.seeds.method)
    valid = every.take(torch.nonzero(every.valid)[:, 0])
    faults = task.check(published[~every.valid]).faults()
    found = f"{len(valid)} of {len(every)} seeds in {task.cfg.seeds.folder} are valid"
    found += f"; of the others, {summarise_faults(faults)}" if faults else ""
    if not len(valid):
        raise InfeasibleError(found)
    log.info("%s", found)
    valid.save(build.folder / LIBRARY)
    features = task.cfg.seeds.published.features()
    if features is not None and len(features) >= len(every):
        write_torch(build.folder / FEATURES, features[: len(every)][every.valid])
    attempts = {"attempts": len(every), "failed": len(every) - len(valid), "faults": dict(faults)}
    write_json(build.folder / REPORT, {**summary(valid), **attempts})


def _shipped(task: Task) -> SeedBatch | None:
    """The seeds where they come with the package; None where they have to be made."""
    settings = task.cfg.seeds
    if settings.shipped is None:
        return None
    return shipped(CONF / "seeds" / settings.shipped, origin(task), settings.count)


def _check(task: Task) -> None:
    settings = task.cfg.seeds
    task.require_room(settings.count, "seeds.count")
    if settings.method == "paper" and _shipped(task) is None:
        require("paper", "pygmo")


def _make(task: Task, build: Build) -> None:
    settings, workers = task.cfg.seeds, task.cfg.parallel.workers
    batch = _shipped(task)
    if batch is None:
        problem = settings.problem(task.constraints, task.trajectory)
        tasks = Tasks(settings.count, settings.batch, build.work, workers)
        batch = make_seeds(problem, settings.optimiser, tasks, task.random("seeds"))
    else:
        log.info("the first %d seeds of %s, made by these settings before", len(batch), settings.shipped)
    library = measured(task.constraints, task.trajectory, batch.coefficients, settings.method)
    library.save(build.folder / LIBRARY)
    build.costs["cpu_seconds"] = batch.cpu_seconds
    attempts = {"attempts": batch.attempts, "failed": batch.failed, "faults": batch.faults}
    write_json(build.folder / REPORT, {**summary(library), **attempts})


STAGES = {"seeds": Stage(lambda task: [seed_set(task)], check=_check)}
