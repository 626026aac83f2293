"""Stage few_seeds: exact variants in the style of ever fewer seeds."""

import logging

from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import Task
from sidegan.pipeline.plan_beyond import few_sizes, with_few
from sidegan.pipeline.stages import gan
from sidegan.pipeline.tracking import Tracker

log = logging.getLogger(__name__)


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Train once on every size, and on all seeds."""
    task = Task(cfg, store)
    for size in few_sizes(task):
        log.info("on %d seeds", size)
        gan.run(with_few(task, size).cfg, store, tracker)
