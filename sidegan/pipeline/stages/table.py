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
    """The module that the setting ``table`` names."""
    name = run.cfg.table
    missing = f"table is {name!r}: there is no such module (the package experiments is only in a clone)"
    if not all(part.isidentifier() for part in name.split(".")):
        raise ConfigError(missing)
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        itself_or_above = f"{name}.".startswith(f"{error.name}.")
        if not itself_or_above:  # another module, which this one imports
            raise
        raise ConfigError(missing) from error


def _check(run: RunContext) -> None:
    module = _module(run)
    if missing := [name for name in ("collect", "present") if not hasattr(module, name)]:
        raise ConfigError(f"table is {run.cfg.table!r}: it has no function {' and no '.join(missing)}")
    if hasattr(module, "check"):
        module.check(run)


def _show(run: RunContext, tracker: Tracker) -> None:
    module = _module(run)
    module.present(module.collect(run), run.store.run_folder, tracker)


STAGES = {"table": Stage(show=_show, check=_check)}
