"""Stage seeds: make the seed set by the configured optimiser."""

import logging
from functools import partial
from pathlib import Path

from sidegan.base.storage import read_json, write_json
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import LIBRARY, REPORT, Task
from sidegan.pipeline.stages.common import measured, numbers, summary, words
from sidegan.pipeline.tracking import Tracker
from sidegan.seeds import Tasks, make_seeds

log = logging.getLogger(__name__)


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Make the seed set."""
    task = Task(cfg, store)
    task.constraints.refuse_home(task.trajectory.home or ())  # before anything is written
    facts = make(task)
    log.info("seeds: %s", words(facts))
    tracker.log_metrics({f"seeds/{key}": value for key, value in facts.items()})


def make(task: Task) -> dict[str, float]:
    """Make the task's seeds unless they are there; what is known of them."""
    folder = task.store.produce(task.seeds, partial(_make, task))
    return numbers(read_json(folder / REPORT))


def _make(task: Task, folder: Path, work: Path) -> None:
    wanted = task.cfg.seeds
    problem = wanted.problem(task.constraints, task.trajectory)
    tasks = Tasks(wanted.count, wanted.batch, work, task.cfg.parallel.workers)
    batch = make_seeds(problem, wanted.optimiser, tasks, task.random("seeds"))
    library = measured(task.constraints, task.trajectory, batch.coefficients, wanted.method)
    library.save(folder / LIBRARY)
    report = {"attempts": batch.attempts, "failed": batch.failed, "cpu_seconds": batch.cpu_seconds}
    write_json(folder / REPORT, {**summary(library), **report, "faults": batch.faults})
