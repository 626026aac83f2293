"""Stage table: print, write and record the experiment's tables and figures."""

import importlib

from sidegan.errors import ConfigError
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.task import Task
from sidegan.pipeline.tracking import Tracker


def _show(task: Task, tracker: Tracker) -> None:
    """Present what the experiment shows."""
    name = f"experiments.{task.cfg.experiment}"
    try:
        experiment = importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        raise ConfigError(f"experiment is {task.cfg.experiment!r}, which has no table") from error
    experiment.present(experiment.collect(task), task.store.run_folder, tracker)


STAGE = Stage(show=_show)
