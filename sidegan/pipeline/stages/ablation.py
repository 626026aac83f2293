"""Stage ablation: train variants that differ from the recipe in one part, and the paper's own recipe."""

import logging

from sidegan.base.storage import read_json
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import HISTORY, Task
from sidegan.pipeline.stages import surrogates
from sidegan.pipeline.stages.common import words
from sidegan.pipeline.stages.train import train_variants
from sidegan.pipeline.tracking import Tracker

log = logging.getLogger(__name__)


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Train every variant of the ablation."""
    task = Task(cfg, store)
    surrogates.make(task, sorted({settings.data for settings in cfg.ablation.values()}), tracker)
    train_variants(task, cfg.ablation, cfg.scale.ablation_trainings)
    for name, settings in cfg.ablation.items():
        for training in cfg.scale.ablation_trainings:
            history = read_json(store.require(task.gan(name, settings, training)) / HISTORY)
            log.info("%s, training %d, after %d epochs: %s", name, training, len(history), words(history[-1]))
