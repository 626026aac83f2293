"""Stage ablation: train variants that differ from the recipe in one part, and the paper's own recipe."""

import logging

from sidegan.artifacts import Store
from sidegan.config import Config
from sidegan.plan import HISTORY, Task
from sidegan.stages import surrogates
from sidegan.stages.common import words
from sidegan.stages.train import train_variants
from sidegan.storage import read_json
from sidegan.tracking import Tracker

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
