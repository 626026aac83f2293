"""Stage kinds: other kinds of seed sets, to compare the seeds with."""

import logging

from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import Task
from sidegan.pipeline.stages import seeds
from sidegan.pipeline.stages.common import words
from sidegan.pipeline.tracking import Tracker

log = logging.getLogger(__name__)


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Make a seed set of each kind."""
    task = Task(cfg, store)
    for name in cfg.kinds:
        facts = seeds.make(task.kind(name))
        log.info("seeds of kind %s: %s", name, words(facts))
        tracker.log_metrics({f"seeds {name}/{key}": value for key, value in facts.items()})
