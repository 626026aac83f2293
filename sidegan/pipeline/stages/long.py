"""Stage long: optimise the single long trajectory in each of its readings."""

import logging
from functools import partial
from pathlib import Path

from sidegan.base.parallel import Report
from sidegan.base.storage import read_json, write_json
from sidegan.design.problem import Problem
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import LIBRARY, REPORT, Task
from sidegan.pipeline.stages.common import measured, numbers, produce_all, words
from sidegan.pipeline.tracking import Tracker
from sidegan.seeds import make_long

log = logging.getLogger(__name__)


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Optimise a long trajectory for each number of harmonics."""
    task = Task(cfg, store)
    stamps = [task.long(h) for h in cfg.long.harmonics]
    produce_all(task, "long trajectories (%)", stamps, [partial(_make, task, h) for h in cfg.long.harmonics])
    for h, stamp in zip(cfg.long.harmonics, stamps):
        report = read_json(store.require(stamp) / REPORT)
        log.info("long trajectory, %d harmonics: %s", h, words(report))
        tracker.log_metrics({f"long/{h}/{key}": value for key, value in numbers(report).items()})


def _make(task: Task, harmonics: int, folder: Path, work: Path, report: Report) -> None:
    settings, trajectory = task.cfg.long, task.long_trajectory(harmonics)
    facts = read_json(task.store.require(task.seeds) / REPORT)
    seconds = settings.factor * task.cfg.selection.count * facts["cpu_seconds"] / facts["count"]
    problem = Problem(task.constraints, trajectory, settings.samples)
    made = make_long(problem, settings.steps, seconds, task.random(f"long {harmonics}"), report)
    library = measured(task.constraints, trajectory, made.coefficients, f"long-{harmonics}")
    library.save(folder / LIBRARY)
    known = {"condition": float(library.fitness[0]), "starts": made.attempts}
    write_json(folder / REPORT, {**known, "cpu_seconds": made.cpu_seconds, "allotted_seconds": seconds})
