"""Stage table: print, write and record the experiment's tables and figures.

The setting ``table`` names a module with the functions ``collect(run)``, ``present(collected, folder,
tracker)`` and optionally ``check(run)``, which may refuse a run before any work.
"""

from importlib import import_module
from types import ModuleType

from sidegan.errors import ConfigError
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.stages import Stage
from sidegan.pipeline.tracking import Tracker


def _module(run: RunContext) -> ModuleType:
    name = run.cfg.table
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if error.name is None or not f"{name}.".startswith(f"{error.name}."):
            raise
        raise ConfigError(
            f"table is {name!r}: there is no such module (experiments are only in a clone)"
        ) from error


def _check(run: RunContext) -> None:
    if hasattr(module := _module(run), "check"):
        module.check(run)


def _show(run: RunContext, tracker: Tracker) -> None:
    module = _module(run)
    module.present(module.collect(run), run.store.run_folder, tracker)


STAGES = {"table": Stage(show=_show, check=_check)}
