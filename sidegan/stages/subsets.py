"""Stage subsets: the variants trained on fewer seeds."""

import logging

from sidegan.artifacts import Store
from sidegan.config import Config
from sidegan.plan import Task, with_subset
from sidegan.stages import gan, surrogates
from sidegan.tracking import Tracker

log = logging.getLogger(__name__)


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Train surrogates and variants on every size."""
    for size in cfg.discussion.sizes:
        log.info("on %d seeds", size)
        smaller = with_subset(Task(cfg, store), size).cfg
        surrogates.run(smaller, store, tracker)
        gan.run(smaller, store, tracker)
