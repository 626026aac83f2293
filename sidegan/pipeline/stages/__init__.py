"""The stages by name; a stage's module is imported when it runs."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

from sidegan.errors import ConfigError

if TYPE_CHECKING:  # imports every room: too slow for `--help`
    from sidegan.pipeline.artifact import Artifact
    from sidegan.pipeline.context import RunContext
    from sidegan.pipeline.tracking import Tracker


@dataclass(frozen=True)
class Stage:
    """A part of an experiment that can be run alone, once its inputs exist."""

    # what it makes, in the order in which MLflow records it
    artifacts: "Callable[[RunContext], Iterable[Artifact]]" = lambda run: ()
    # prints results, and writes them to the run's folder; None: there are none to show
    show: "Callable[[RunContext, Tracker], None] | None" = None
    check: "Callable[[RunContext], object]" = lambda run: None  # may raise, to refuse a run before any stage


_MODULES = {  # the stages in each file of this folder
    "seeds": ["seeds"],
    "training": ["surrogates", "gan", "subsets"],
    "selection": ["library", "selection"],
    "baselines": ["random", "long"],
    "measures": ["measures", "variations"],
    "identification": ["identification", "plant"],
    "replication": ["replication"],
    "discussion": ["density", "timing"],
    "excite": ["excite"],
    "identify": ["check", "identify"],
    "payload": ["payload", "gains"],
    "table": ["table"],
}
STAGES = {name: module for module, names in _MODULES.items() for name in names}


def stage(name: str) -> Stage:
    """The stage with this name; a ConfigError if there is none."""
    if name not in STAGES:
        raise ConfigError(f"stages: there is no stage {name!r}, expected some of {', '.join(STAGES)}")
    return import_module(f"sidegan.pipeline.stages.{STAGES[name]}").STAGES[name]
