"""What happens around the jobs: threads, and of a sweep the parent run and the table over all jobs."""

import logging
import math
import os
import re
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydra.experimental.callback import Callback
from omegaconf import DictConfig, OmegaConf

from sidegan.base.names import folder_name
from sidegan.base.storage import read_json
from sidegan.errors import SideganError
from sidegan.pipeline.stages import STAGES
from sidegan.pipeline.tracking import Status, Tracker

if TYPE_CHECKING:
    import pandas as pd

log = logging.getLogger(__name__)

PARENT = "SIDEGAN_PARENT_RUN"  # environment variable: the jobs of a sweep may be other processes
STATUS = "status.json"


def times(*factors: Any) -> float | None:
    """A product; null where a factor is no number, which is then refused by its own name too."""
    return math.prod(factors) if all(isinstance(x, int | float) for x in factors) else None


OmegaConf.register_new_resolver("folder_name", folder_name, replace=True)
OmegaConf.register_new_resolver("times", times, replace=True)
_STAGES = "\n".join(f"  {name:<16}{text}" for name, text in STAGES.items())
OmegaConf.register_new_resolver("stages", lambda: _STAGES, replace=True)

_parent: Tracker | None = None


class SweepCallback(Callback):
    """Hydra calls it before and after a run or a sweep."""

    def on_run_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Limit the threads."""
        _limit_threads(config.parallel.threads)

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Limit the threads and open the parent run."""
        global _parent
        _limit_threads(config.parallel.threads)
        folder = Path(config.hydra.sweep.dir)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:  # Hydra fails at the same next, and its error is the one that is shown
            return
        hidden = ("+experiment=", "outputs=")
        swept = " ".join(name for name in config.hydra.overrides.task if not name.startswith(hidden))
        name = f"{config.experiment} sweep {swept}".strip()[:200]
        uri, enabled = config.tracking.uri, config.tracking.enabled
        _parent = Tracker(Path(config.outputs), folder, config.experiment, name, uri, enabled)
        if _parent.run_id is not None:
            os.environ[PARENT] = _parent.run_id

    def on_multirun_end(self, config: DictConfig, **kwargs: Any) -> None:
        """Record the table over all jobs, close the parent run, and leave with the worst job's code."""
        sweep = Path(config.hydra.sweep.dir)
        codes = job_codes(sweep)
        finished = [folder for folder, code in codes.items() if code == 0]
        failed = [folder for folder, code in codes.items() if code != 0]
        worst = max(codes.values(), default=1)
        try:
            table = aggregate(config.experiment, finished, sweep)
            if table is not None and _parent is not None:
                from sidegan.report.export import markdown

                _parent.log_table(table, "sweep")
                _parent.log_note(markdown(table.reset_index()))
        except Exception:
            log.exception("the table over all jobs could not be made")
            worst = max(worst, 1)
        for folder in failed:
            log.error("error: job %s failed, see %s", folder.name, folder)
        end_sweep("FAILED" if worst else "FINISHED")
        if worst:
            raise SystemExit(worst)


def end_sweep(status: Status) -> None:
    """Close the parent run, if one is open."""
    global _parent
    os.environ.pop(PARENT, None)
    if _parent is not None:
        _parent.finish(status)
    _parent = None


def job_codes(sweep: Path) -> dict[Path, int]:
    """Exit code of each job of a sweep by its folder, in the order of the jobs."""
    numbers = {folder: re.match(r"\d+", folder.name) for folder in sweep.iterdir() if folder.is_dir()}
    folders = sorted((int(number[0]), folder) for folder, number in numbers.items() if number)
    codes = dict.fromkeys((folder for _, folder in folders), 1)
    for folder in codes:
        with suppress(SideganError):  # the job was killed before it could tell
            codes[folder] = read_json(folder / STATUS)["code"]
    return codes


def aggregate(experiment: str, folders: list[Path], sweep: Path) -> "pd.DataFrame | None":
    """Table over the finished jobs: the experiment's own ``aggregate(folders, sweep)``, if it has one."""
    name = f"experiments.{experiment}"
    try:
        module = import_module(name)
    except ModuleNotFoundError as error:
        if error.name not in (name, "experiments"):
            raise
        return None
    hook = getattr(module, "aggregate", None)
    return hook(folders, sweep) if hook is not None and folders else None


def _limit_threads(threads: int | None) -> None:
    """Set the number of threads; NumPy and torch read it when they are imported."""
    if threads is not None:
        for library in ("OMP", "OPENBLAS", "MKL"):
            os.environ[f"{library}_NUM_THREADS"] = str(threads)
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # a thread that waits must not keep a core busy
