"""A run: the stages of an experiment in order, tracked as one, and what is left of it when it ends."""

import errno
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

if TYPE_CHECKING:  # and with it every room, which `--help` must not wait for
    from sidegan.pipeline.settings import Config

log = logging.getLogger(__name__)

FAILURE, BAD_CONFIG, INTERRUPTED = 1, 2, 130  # exit codes

interrupts: list[int] = []  # signals that this process got
_STORAGE = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM, errno.ENOTDIR, errno.EEXIST}


def run_stages(config: "Config", run_folder: Path, name: str, overrides: Sequence[str] = ()) -> None:
    """Run the configured stages in order, tracked as one run of this name.

    Its logs and tables go into its folder; other conditions are composed from the command's overrides. What
    cannot work is refused by a ConfigError before any work.
    """
    from sidegan.pipeline.context import RunContext
    from sidegan.pipeline.stage import run_stage
    from sidegan.pipeline.stages import stage

    if not config.stages:
        raise ConfigError(
            f"there is nothing to run: give +experiment=…, or 'stages=[…]' of {', '.join(STAGES)}"
        )
    stages = {one: stage(one) for one in config.stages}
    run = RunContext(config, Store(Path(config.outputs), run_folder), tuple(overrides))
    for one in stages.values():  # what cannot work is refused before anything has been made
        list(one.artifacts(run))
        one.check(run)
    tags = {"mlflow.parentRunId": os.environ[PARENT]} if PARENT in os.environ else {}
    tracker = Tracker(run.store.root, config.experiment, name, config.tracking, tags)
    with tracker, on_cluster(config.parallel.scheduler):
        tracker.log_params(config.plain())
        if config.has("robot"):
            run.log_decisions()
        for title, one in stages.items():
            log.info("%s …", title)
            began = time.monotonic()
            run_stage(title, one, run, tracker)
            seconds = time.monotonic() - began
            log.info("%s: done in %s", title, duration(seconds))
            tracker.log_metrics({f"stage seconds/{title}": seconds})


def run_job(cfg: DictConfig, run_folder: Path, name: str, overrides: Sequence[str] = ()) -> int:
    """Exit code of ``run_stages`` with composed settings; its outcome is logged and left in its folder."""
    from sidegan.pipeline.settings import validate

    try:
        run_stages(validate(cfg), run_folder, name, overrides)
    except (Exception, KeyboardInterrupt) as error:
        if interrupts or isinstance(error, KeyboardInterrupt):
            # Whoever was at work may have lost the exception, and have failed at what it left undone.
            _leave(run_folder, INTERRUPTED, "interrupted")
            raise KeyboardInterrupt from error
        code = BAD_CONFIG if isinstance(error, ConfigError) else FAILURE
        if isinstance(error, SideganError) or getattr(error, "errno", None) in _STORAGE:
            log.error("error: %s", error)
        else:
            log.exception("error: unexpected %s", type(error).__name__)
        _leave(run_folder, code, f"{type(error).__name__}: {error}")
        return code
    _leave(run_folder, 0, None)
    return 0


def _leave(run_folder: Path, code: int, error: str | None) -> None:
    with suppress(StorageError):  # when the disk is full, that is what is told
        write_json(run_folder / STATUS, {"code": code, "error": error})
