"""Stage table: print, write and record the experiment's tables and figures."""

import importlib

from sidegan.errors import ConfigError
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import Task
from sidegan.pipeline.tracking import Tracker


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Present what the experiment shows."""
    name = f"experiments.{cfg.experiment}"
    try:
        experiment = importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        raise ConfigError(f"experiment is {cfg.experiment!r}, which has no table") from error
    experiment.present(experiment.collect(Task(cfg, store)), store.run_folder, tracker)
