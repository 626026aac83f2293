"""Run the stages of an experiment in order, tracked as one run, and record how it ends."""

import logging
import os
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from omegaconf import DictConfig

from sidegan.base.parallel import on_cluster
from sidegan.base.progress import duration
from sidegan.base.storage import write_json
from sidegan.errors import ConfigError, SideganError, StorageError
from sidegan.pipeline.stages import STAGES
from sidegan.pipeline.store import Store
from sidegan.pipeline.sweep import PARENT, STATUS
from sidegan.pipeline.tracking import Tracker

if TYPE_CHECKING:  # imports every room: too slow for `--help`
    from sidegan.pipeline.settings import Config

log = logging.getLogger(__name__)

FAILURE, BAD_CONFIG, INTERRUPTED = 1, 2, 130  # exit codes

interrupts: list[int] = []  # signals that this process received


def run_stages(config: "Config", run_folder: Path, name: str, overrides: Sequence[str] = ()) -> None:
    """Run the configured stages in order, tracked as one run of this name.

    Logs and tables go into the run's folder; other conditions are composed from the command's overrides. A
    ConfigError refuses impossible settings before any work.
    """
    from sidegan.pipeline.context import RunContext
    from sidegan.pipeline.stage import run_stage
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
    tags = {"mlflow.parentRunId": os.environ[PARENT]} if PARENT in os.environ else {}
    tracker = Tracker(run.store.root, config.experiment, name, config.tracking, tags)
    with tracker, on_cluster(config.parallel.scheduler):
        tracker.log_params(config.plain())
        if config.has("robot"):
            run.log_decisions()
        for title, part in stages.items():
            log.info("%s …", title)
            began = time.monotonic()
            run_stage(title, part, run, tracker)
            seconds = time.monotonic() - began
            log.info("%s: done in %s", title, duration(seconds))
            tracker.log_metrics({f"stage seconds/{title}": seconds})


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
        if isinstance(error, SideganError | OSError):  # of the disk, such as a full one
            log.error("error: %s", error)
        else:
            log.exception("error: unexpected %s", type(error).__name__)
        _save_status(run_folder, code, f"{type(error).__name__}: {error}")
        return code
    _save_status(run_folder, 0, None)
    return 0


def _save_status(run_folder: Path, code: int, error: str | None) -> None:
    with suppress(StorageError):  # a full disk must not hide the run's own error
        write_json(run_folder / STATUS, {"code": code, "error": error})
