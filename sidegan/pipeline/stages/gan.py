"""Stage gan: train the configured variants."""

import logging

from sidegan.base.storage import read_json
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import HISTORY, Task
from sidegan.pipeline.stages.common import words
from sidegan.pipeline.stages.train import train_variants
from sidegan.pipeline.tracking import Tracker

log = logging.getLogger(__name__)


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Train the variants, and record their metrics after every epoch."""
    task = Task(cfg, store)
    train_variants(task, cfg.gan, cfg.trainings)
    for name, settings in cfg.gan.items():
        for training in cfg.trainings:
            history = read_json(store.require(task.gan(name, settings, training)) / HISTORY)
            title = task.named(name, training)
            for key in history[0]:
                known = [(i, row[key]) for i, row in enumerate(history) if row[key] is not None]
                tracker.log_history({f"{title}/{key}": [v for _, v in known]}, [i for i, _ in known])
            log.info("%s after %d epochs: %s", title, len(history), words(history[-1]))
