"""Stage optimised: seeds that use as much of the limits as exact variants do, the fair opponent of both."""

import logging
from functools import partial
from pathlib import Path

from sidegan.base.storage import read_json, write_json
from sidegan.design.problem import Problem
from sidegan.pipeline import plan_beyond
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import LIBRARY, REPORT, Task
from sidegan.pipeline.stages.common import measured, numbers, summary, words
from sidegan.pipeline.tracking import Tracker
from sidegan.seeds import Gradient, Tasks, make_seeds

log = logging.getLogger(__name__)


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Make as many as there are seeds, with little reserve."""
    task = Task(cfg, store)
    folder = store.produce(plan_beyond.optimised(task), partial(_make, task))
    facts = numbers(read_json(folder / REPORT))
    log.info("optimised with little reserve: %s", words(facts))
    tracker.log_metrics({f"optimised/{key}": value for key, value in facts.items()})


def _make(task: Task, folder: Path, work: Path) -> None:
    wanted = task.cfg.seeds
    problem = Problem(task.constraints, task.trajectory, wanted.samples)
    method = Gradient(task.cfg.scale.seed_steps, wanted.attempts, task.cfg.beyond.reserve)
    tasks = Tasks(wanted.count, wanted.batch, work, task.cfg.parallel.workers)
    batch = make_seeds(problem, method, tasks, task.random("optimised"))
    made = measured(task.constraints, task.trajectory, batch.coefficients, plan_beyond.OPTIMISED)
    made.save(folder / LIBRARY)
    told = {"attempts": batch.attempts, "failed": batch.failed, "cpu_seconds": batch.cpu_seconds}
    known = {"valid_share": 1 - batch.failed / batch.attempts, "each": batch.cpu_seconds / len(made)}
    write_json(folder / REPORT, {**summary(made), **told, **known})
