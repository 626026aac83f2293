"""One short module per stage: load artifacts, call the rooms below, save artifacts.

Each stage takes (configuration, store, tracker) and may be run alone: what it needs must be there already.
A stage's module is imported when it runs, so that starting one does not load what only others need.
"""

from importlib import import_module

from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.tracking import Tracker

_NAMES = (
    "seeds",
    "surrogates",
    "gan",
    "library",
    "random",
    "long",
    "selection",
    "identification",
    "plant",
    "replication",
    "kinds",
    "sensitivity",
    "subsets",
    "density",
    "ablation",
    "timing",
    "first_set",
    "polish",
    "optimised",
    "best",
    "objectives",
    "few_seeds",
    "transfer",
    "conditional",
    "excite",
    "check",
    "identify",
    "table",
)


class _Stage:
    """A stage that is imported when it is called."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __call__(self, config: Config, store: Store, tracker: Tracker) -> None:
        import_module(f"sidegan.pipeline.stages.{self.name}").run(config, store, tracker)


STAGES = {name: _Stage(name) for name in _NAMES}
