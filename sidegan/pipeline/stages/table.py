"""Stage table: print, write and record the experiment's tables and figures."""

import importlib
from types import ModuleType

from sidegan.errors import ConfigError
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.task import Task
from sidegan.pipeline.tracking import Tracker


def _experiment(task: Task) -> ModuleType:
    name = f"experiments.{task.cfg.experiment}"
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        raise ConfigError(f"experiment is {task.cfg.experiment!r}, which has no table") from error


def _check(task: Task) -> None:
    """Let an experiment refuse what it could not show, where it has a ``check(task)``."""
    refuse = getattr(_experiment(task), "check", None)
    if refuse is not None:
        refuse(task)


def _show(task: Task, tracker: Tracker) -> None:
    """Present what the experiment shows."""
    experiment = _experiment(task)
    experiment.present(experiment.collect(task), task.store.run_folder, tracker)


STAGE = Stage(show=_show, check=_check)
