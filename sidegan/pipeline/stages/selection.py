"""Stage selection: pick the excitation sets from the seeds, and from the seeds and each library."""

import logging
from functools import partial
from pathlib import Path

from torch import Tensor

from sidegan.design.selection import choose
from sidegan.library import Library
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import LIBRARY, RANDOM, SEEDS, Task
from sidegan.pipeline.stages.common import load
from sidegan.pipeline.tracking import Tracker

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
    pool.take(pick(task, pool)).save(folder / LIBRARY)


def pick(task: Task, pool: Library) -> Tensor:
    """Indices of the configured pick from a pool, in the order of choice, (count,)."""
    return choose(task.cfg.selection, task.body, task.trajectory, pool.coefficients, pool.diagonal)
