"""Stage polish: what gradient steps on generated trajectories bring, and what they cost."""

import logging
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
import torch
from torch import Tensor

from sidegan.base.parallel import Job, Report, run_jobs
from sidegan.base.storage import read_json, write_json, write_parquet
from sidegan.design.polish import Polish
from sidegan.design.problem import Problem
from sidegan.errors import InfeasibleError
from sidegan.gan import TrajectoryGenerator
from sidegan.gan.metrics import measure
from sidegan.pipeline import plan_beyond
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import GENERATOR, LIBRARY, RANDOM, REPORT, RESULTS, Task
from sidegan.pipeline.stages.common import measured, produce_all, summary, words
from sidegan.pipeline.tracking import Tracker
from sidegan.report.tables import arrow
from sidegan.seeds import Gradient
from sidegan.validity import check

log = logging.getLogger(__name__)

_SPARE = 8  # drawn beyond what is missing: a few stay invalid
_MOST = 20  # draws per trajectory wanted


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Measure the curve, and polish a library from every training."""
    task = Task(cfg, store)
    stamps = [plan_beyond.polished(task, training) for training in cfg.trainings]
    makes = [partial(_library, task, training) for training in cfg.trainings]
    produce_all(task, "polished libraries (%)", stamps, makes)
    for training, stamp in zip(cfg.trainings, stamps):
        log.info("polished library %d: %s", training, words(read_json(store.require(stamp) / REPORT)))
    folder = store.produce(plan_beyond.polish(task), partial(_make, task))
    for row in pd.read_parquet(folder / RESULTS).to_dict("records"):
        log.info(
            "%s, %d steps: cond %.4g, %.1f %% valid, %.3g CPU s each",
            row["start"],
            row["steps"],
            row["condition"],
            100 * row["success"],
            row["seconds"],
        )


def _make(task: Task, folder: Path, work: Path) -> None:
    wanted, path = task.cfg.beyond, task.store.require(plan_beyond.source_stamp(task))
    jobs: list[Job] = [partial(_polished, task, path / GENERATOR, steps) for steps in [0, *wanted.steps]]
    jobs += [partial(_optimised, task, steps) for steps in wanted.steps]
    rows = run_jobs("polish (%)", jobs, task.cfg.parallel.workers)
    write_parquet(folder / RESULTS, arrow(pd.DataFrame(rows)))


def _library(task: Task, training: int, folder: Path, work: Path, report: Report) -> None:
    """As many polished valid trajectories as there are seeds, and what they cost."""
    count, problem = task.cfg.seeds.count, _problem(task)
    path = task.store.require(plan_beyond.source_stamp(task, training)) / GENERATOR
    generator = TrajectoryGenerator.load(path, task.arm)
    noise = torch.Generator().manual_seed(task.number("polished", training))
    began = time.process_time()
    kept: list[Tensor] = []
    drawn = found = 0
    while found < count and drawn < _MOST * count:
        few = min(task.cfg.library.batch, _SPARE + count - found)
        c = Polish(task.cfg.beyond.finish).improve(problem, generator.sample(few, noise))
        kept.append(c[check(task.constraints, task.trajectory, c).valid])
        drawn, found = drawn + len(c), found + len(kept[-1])
        report(min(found, count), count)
    if found < task.cfg.selection.count:
        raise InfeasibleError(
            f"of {drawn} polished trajectories of {plan_beyond.source(task)} {found} are valid"
        )
    spent = time.process_time() - began
    made = measured(task.constraints, task.trajectory, torch.cat(kept)[:count], plan_beyond.POLISHED)
    made.save(folder / LIBRARY)
    share = {"drawn": drawn, "valid_share": found / drawn, "each": spent / found}
    write_json(folder / REPORT, share | summary(made))


def _polished(task: Task, path: Path, steps: int, report: Report) -> dict[str, Any]:
    """Quality and cost of generated trajectories after so many steps."""
    count, problem, generator = (
        task.cfg.beyond.polished,
        _problem(task),
        TrajectoryGenerator.load(path, task.arm),
    )
    Polish(1).improve(problem, generator.sample(2))  # what is made once does not count
    began = time.process_time()
    c = generator.sample(count, task.number("polish"))
    if steps:
        c = Polish(steps).improve(problem, c)
    spent = time.process_time() - began
    return _row(task, plan_beyond.source(task), steps, c, spent)


def _optimised(task: Task, steps: int, report: Report) -> dict[str, Any]:
    """The same of the seeds' optimiser from random starts, with the same reserve."""
    count = task.cfg.beyond.polished
    problem, random = _problem(task), task.random("polish from random")
    method = Gradient(steps, attempts=1, reserve=Polish(1).reserve)
    replace(method, steps=1).optimise(problem, 2, random)
    began = time.process_time()
    found = method.optimise(problem, count, random)
    spent = time.process_time() - began
    row = _row(task, RANDOM, steps, found.coefficients, spent * len(found) / count)
    return row | {"success": len(found) / count}


def _row(task: Task, start: str, steps: int, c: Tensor, spent: float) -> dict[str, Any]:
    """Metrics of trajectories that took so long [s]; of none they are not known."""
    if len(c) < 2:
        return {"start": start, "steps": steps, "seconds": float("nan"), "condition": float("nan")}
    facts = measure(task.constraints, task.trajectory, c)
    return {"start": start, "steps": steps, "seconds": spent / len(c), **facts}


def _problem(task: Task) -> Problem:
    return Problem(task.constraints, task.trajectory)
