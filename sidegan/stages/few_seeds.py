"""Stage few_seeds: exact variants in the style of ever fewer seeds."""

import logging

from sidegan.artifacts import Store
from sidegan.config import Config
from sidegan.plan import Task
from sidegan.plan_beyond import few_sizes, with_few
from sidegan.stages import gan
from sidegan.tracking import Tracker

log = logging.getLogger(__name__)


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Train once on every size, and on all seeds."""
    task = Task(cfg, store)
    for size in few_sizes(task):
        log.info("on %d seeds", size)
        gan.run(with_few(task, size).cfg, store, tracker)
