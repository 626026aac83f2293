"""Stage seeds: the seed set, from the configured optimiser or published."""

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.conf import CONF
from sidegan.base.extras import require
from sidegan.base.storage import write_arrays, write_json
from sidegan.errors import InfeasibleError
from sidegan.library import LIBRARY
from sidegan.library.measure import library_of, summary
from sidegan.pipeline.artifact import Artifact, Build, Metrics
from sidegan.pipeline.context import REPORT, RunContext, report_and_history
from sidegan.pipeline.stages import Stage
from sidegan.seeding.optimise import SeedBatch, shipped
from sidegan.steps.seeds import optimised
from sidegan.validity import summarise_faults

FEATURES = "features.npz"  # the authors' features of their seeds
_log = logging.getLogger(__name__)


def seed_set(run: RunContext) -> Artifact:
    """The seed set; each method is a separate maker."""
    settings = run.cfg.seeds
    maker = "seeds" if settings.method == "gradient" else f"{settings.method}_seeds"
    how = _read if settings.method == "published" else make
    return run.artifact(
        maker, settings.method, how, settings.stamped(), title="seeds", metrics=_metrics, alone=True
    )


def origin(run: RunContext) -> dict[str, Any]:
    """Parameters of the set except its size: the first seeds of a larger set are a smaller set."""
    params = seed_set(run).params
    settings = params["settings"]["paper_seeds"]
    kept = {name: x for name, x in settings.items() if name != "count"}
    return {**params, "settings": {**params["settings"], "paper_seeds": kept}}


def _read(run: RunContext, build: Build) -> None:
    """Save the valid ones among published seeds."""
    published = run.cfg.seeds.published.read(run.cell.trajectory)[: run.cfg.seeds.count]
    seeds = library_of(run.cell.constraints, run.cell.trajectory, published, run.cfg.seeds.method)
    valid = seeds.take(np.flatnonzero(seeds.valid))
    faults = run.cell.check(published[~seeds.valid]).faults()
    found = f"{len(valid)} of {len(seeds)} seeds in {run.cfg.seeds.folder} are valid"
    found += f"; of the others, {summarise_faults(faults)}" if faults else ""
    if not len(valid):
        raise InfeasibleError(found)
    _log.info("%s", found)
    valid.save(build.folder / LIBRARY)
    features = run.cfg.seeds.published.features()
    if features is not None and len(features) >= len(seeds):
        write_arrays(build.folder / FEATURES, {"diagonal": features[: len(seeds)][seeds.valid]})
    attempts = {"attempts": len(seeds), "failed": len(seeds) - len(valid), "faults": dict(faults)}
    write_json(build.folder / REPORT, {**summary(valid), **attempts})


def _shipped(run: RunContext) -> SeedBatch | None:
    """Seeds that come with the package; None if they have to be computed."""
    settings = run.cfg.seeds
    if settings.shipped is None:
        return None
    return shipped(CONF / "seeds" / settings.shipped, origin(run), settings.count)


def _metrics(folder: Path) -> Metrics:
    """Numbers to record, with numbers of starts in proportion to these seeds.

    If they are the first of a shipped file, the report has the starts of the whole file.
    """
    numbers: dict[str, Any] = dict(report_and_history(folder))
    share = numbers["count"] / (numbers["attempts"] - numbers["failed"])
    return numbers | {key: round(share * numbers[key]) for key in ("attempts", "failed")}


def _check(run: RunContext) -> None:
    settings = run.cfg.seeds
    if settings.method == "paper" and _shipped(run) is None:
        require("paper", "pygmo")


def make(run: RunContext, build: Build) -> None:
    """Make the seeds by the configured optimiser."""
    settings = run.cfg.seeds
    batch = _shipped(run)
    if batch is None:
        batch = optimised(run.cell, settings, run.cfg.seed, build.work, run.cfg.parallel.workers)
    else:
        _log.info("the first %d seeds of %s, made by these settings before", len(batch), settings.shipped)
    build.costs["cpu_seconds"] = batch.cpu_seconds
    attempts = {"attempts": batch.attempts, "failed": batch.failed, "faults": batch.faults}
    save_set(run, build, batch.coefficients, settings.method, attempts)


def save_set(run: RunContext, build: Build, c: Array, name: str, facts: Mapping[str, Any]) -> None:
    """Write coefficients [rad/s], (N, J, H, 2), as a measured library, and its summary with more facts."""
    library = library_of(run.cell.constraints, run.cell.trajectory, c, name)
    library.save(build.folder / LIBRARY)
    write_json(build.folder / REPORT, {**summary(library), **facts})


STAGES = {"seeds": Stage(lambda run: [seed_set(run)], check=_check)}
