"""Stage subsets: the variants trained on fewer seeds."""

import logging

from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import Task, with_subset
from sidegan.pipeline.stages import gan, surrogates
from sidegan.pipeline.tracking import Tracker

log = logging.getLogger(__name__)


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Train surrogates and variants on every size."""
    for size in cfg.discussion.sizes:
        log.info("on %d seeds", size)
        smaller = with_subset(Task(cfg, store), size).cfg
        surrogates.run(smaller, store, tracker)
        gan.run(smaller, store, tracker)
