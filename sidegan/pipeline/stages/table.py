"""Stage table: print, write and record the experiment's tables and figures.

The experiment's setting ``table`` names the module that does so, by its functions ``collect(task)``,
``present(collected, folder, tracker)`` and, where it may refuse a task before any work, ``check(task)``.
"""

from importlib import import_module
from types import ModuleType

from sidegan.errors import ConfigError
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.task import Task
from sidegan.pipeline.tracking import Tracker


def _module(task: Task) -> ModuleType:
    name = task.cfg.table
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if error.name is None or not f"{name}.".startswith(f"{error.name}."):
            raise
        raise ConfigError(
            f"table is {name!r}: there is no such module (experiments are in a clone alone)"
        ) from error


def _check(task: Task) -> None:
    if hasattr(module := _module(task), "check"):
        module.check(task)


def _show(task: Task, tracker: Tracker) -> None:
    module = _module(task)
    module.present(module.collect(task), task.store.run_folder, tracker)


STAGES = {"table": Stage(show=_show, check=_check)}
