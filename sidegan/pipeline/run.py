"""Run the stages of an experiment, tracked as one run, and record how it ends."""

import errno
import logging
import time
from collections.abc import Iterable, Sequence
from contextlib import suppress
from functools import partial
from graphlib import TopologicalSorter
from pathlib import Path
from typing import TYPE_CHECKING

from omegaconf import DictConfig

from sidegan.base.names import plain
from sidegan.base.parallel import on_cluster, run_jobs
from sidegan.base.progress import duration
from sidegan.base.settings_text import command_messages
from sidegan.base.storage import read_json, write_json
from sidegan.errors import ConfigError, SideganError, StorageError
from sidegan.pipeline.artifact import Artifact
from sidegan.pipeline.stages import STAGES
from sidegan.pipeline.store import Store
from sidegan.pipeline.sweep import STATUS, parent_run
from sidegan.pipeline.tracking import Tracker

if TYPE_CHECKING:  # imports every room: too slow for `--help`
    from sidegan.pipeline.context import RunContext
    from sidegan.pipeline.settings import Config

_log = logging.getLogger(__name__)

MODELS = {"gan", "identify"}  # makers whose artifacts MLflow lists as models
ARTIFACTS = "artifacts.json"  # in the run's folder
FAILURE, BAD_CONFIG, INTERRUPTED = 1, 2, 130  # exit codes

interrupts: list[int] = []  # signals that this process received
_STORAGE = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM, errno.ENOTDIR, errno.EEXIST}


def run_stages(config: "Config", run_folder: Path, name: str, overrides: Sequence[str] = ()) -> None:
    """Run the configured stages, tracked as one run of this name.

    Stages up to one that shows results are made together, which keeps all cores busy. Logs and tables go into
    the run's folder; other conditions are composed from the command's overrides. A ConfigError refuses
    impossible settings before any work.
    """
    from sidegan.pipeline.context import RunContext
    from sidegan.pipeline.stages import stage

    if not config.stages:
        raise ConfigError(
            f"there is nothing to run: give +experiment=…, or 'stages=[…]' of {', '.join(STAGES)}"
        )
    stages = {title: stage(title) for title in config.stages}
    run = RunContext(config, Store(Path(config.outputs), run_folder), tuple(overrides))
    for part in stages.values():  # all checks come before any work
        list(part.artifacts(run))
        part.check(run)
    tracker = Tracker(run.store.root, config.experiment, name, config.tracking, parent_run(run_folder))
    run.store.curves = tracker.curves
    with tracker, on_cluster(config.parallel.scheduler):
        tracker.log_params(config.plain())
        if config.has("robot"):
            run.log_decisions()
        names = list[str]()
        for title, part in stages.items():
            names.append(title)
            if part.show is None and title != config.stages[-1]:
                continue
            together = ", ".join(names)
            _log.info("%s …", together)
            began = time.monotonic()
            make_all([x for each in names for x in stages[each].artifacts(run)], run, tracker)
            if part.show is not None:
                part.show(run, tracker)
            _log.info("%s: done in %s", together, duration(time.monotonic() - began))
            names = []


def make_all(wanted: Iterable[Artifact], run: "RunContext", tracker: Tracker) -> None:
    """Make missing artifacts, each after its inputs, and record all of them."""
    artifacts = {artifact.digest: artifact for artifact in wanted}
    missing = {digest for digest, artifact in artifacts.items() if run.store.find(artifact) is None}
    if missing and run.planning:
        _ = run.cell.constraints  # raises, before anything is written, if the arm cannot rest at home
    order = TopologicalSorter[str]()
    for digest, artifact in artifacts.items():
        parents = {source.digest for source in artifact.inputs.values() if isinstance(source, Artifact)}
        order.add(digest, *(parents & artifacts.keys()))
    order.prepare()
    while ready := order.get_ready():
        beside = [digest for digest in ready if digest in missing and not artifacts[digest].alone]
        for digest in ready:  # those that are parallel themselves one by one, all others in a process each
            if digest not in beside:
                run.store.produce(artifacts[digest])
        if beside:
            makers = dict.fromkeys(artifacts[digest].maker for digest in beside)
            jobs = [partial(run.store.produce, artifacts[digest]) for digest in beside]
            run_jobs(f"{', '.join(makers)} (%)", jobs, run.cfg.parallel.workers)
        order.done(*ready)
        for digest in ready:
            if digest not in tracker.recorded:  # parts of an experiment may share artifacts
                tracker.recorded.add(digest)
                _record(artifacts[digest], run, tracker)
        path = run.store.run_folder / ARTIFACTS  # their folders below the outputs, by title
        known = read_json(path) if path.exists() else {}
        found = {artifacts[digest].title: artifacts[digest].folder.as_posix() for digest in ready}
        write_json(path, known | found)


def _record(artifact: Artifact, run: "RunContext", tracker: Tracker) -> None:
    """Log an artifact's metrics and costs, and record it if it is a model."""
    title = artifact.title
    folder = run.store.require(artifact)
    metrics = artifact.metrics(folder)
    numbers = {key: float(x) for key, x in metrics.items() if isinstance(x, int | float)}
    series = {key: x for key, x in metrics.items() if not isinstance(x, int | float)}
    spent = {key: float(x) for key, x in run.store.costs(artifact).items() if isinstance(x, int | float)}
    model = tracker.log_model(title, artifact.digest, folder) if artifact.maker in MODELS else None
    # MLflow groups charts by prefix: an artifact's results together, and one kind of cost over all artifacts.
    tracker.log_metrics({f"{title}/{key}": x for key, x in numbers.items()}, model)
    tracker.log_metrics({f"{key}/{title.replace('/', ' ')}": x for key, x in spent.items()})
    tracker.log_history({f"{title}/{key}": x for key, x in series.items()}, model)
    last = {key: x[-1] for key, x in series.items() if x and x[-1] is not None}
    epochs = max(map(len, series.values()), default=0)
    when, found = ("", numbers | spent) if numbers or not series else (f" after {epochs} epochs", last)
    texts = [f"{k} {plain(x, '.4g')}" if isinstance(x, float) else f"{k} {x}" for k, x in found.items()]
    _log.info("%s%s: %s", title, when, ", ".join(texts))


@command_messages()
def run_job(cfg: DictConfig, run_folder: Path, name: str, overrides: Sequence[str] = ()) -> int:
    """Call ``run_stages`` with composed settings; log and save the outcome, and return the exit code."""
    from sidegan.pipeline.settings import validate

    try:
        run_stages(validate(cfg), run_folder, name, overrides)
    except (Exception, KeyboardInterrupt) as error:
        if interrupts or isinstance(error, KeyboardInterrupt):
            # A library may have swallowed the interrupt and failed later with an error that follows from it.
            _save_status(run_folder, INTERRUPTED, "interrupted")
            raise KeyboardInterrupt from error
        code = BAD_CONFIG if isinstance(error, ConfigError) else FAILURE
        if isinstance(error, SideganError) or getattr(error, "errno", None) in _STORAGE:
            _log.error("error: %s", error)
        else:
            _log.exception("error: unexpected %s", type(error).__name__)
        _save_status(run_folder, code, f"{type(error).__name__}: {error}")
        return code
    _save_status(run_folder, 0, None)
    return 0


def _save_status(run_folder: Path, code: int, error: str | None) -> None:
    with suppress(StorageError):  # a full disk must not hide the run's own error
        write_json(run_folder / STATUS, {"code": code, "error": error})
