"""Stage selection: pick the excitation sets greedily, from the seeds and from the seeds and each library."""

import logging
from functools import partial
from pathlib import Path

from sidegan.artifacts import Store
from sidegan.config import Config
from sidegan.library import Library
from sidegan.plan import LIBRARY, RANDOM, SEEDS, Task
from sidegan.selection import greedy
from sidegan.stages.common import load
from sidegan.tracking import Tracker

log = logging.getLogger(__name__)


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Pick every set."""
    task = Task(cfg, store)
    for name, training in task.short_sets():
        folder = store.produce(task.selection(name, training), partial(_make, task, name, training))
        chosen, title = Library.load(folder / LIBRARY, task.arm), task.named(name, training)
        new = sum(source != cfg.seeds.method for source in chosen.source)
        log.info("selection from %s: %d, %d of them not seeds", title, len(chosen), new)
        tracker.log_metrics({f"selection/{title}/generated": new})


def _make(task: Task, name: str, training: int, folder: Path, work: Path) -> None:
    pool = load(task, task.random_set if name == RANDOM else task.seeds)
    if name not in (SEEDS, RANDOM):
        pool = pool.merge(load(task, task.library(name, training)))
    pool.take(greedy(pool.diagonal, task.cfg.selection.count)).save(folder / LIBRARY)
