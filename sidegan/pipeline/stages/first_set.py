"""Stage first_set: how long it takes to a first set of valid trajectories, on one core."""

import logging
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import torch
from torch import Tensor

from sidegan.base.parallel import Report
from sidegan.base.storage import read_json, write_json
from sidegan.design.problem import Problem
from sidegan.gan import TrajectoryGenerator
from sidegan.pipeline import plan_beyond
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import GENERATOR, RANDOM, REPORT, SEEDS, Task
from sidegan.pipeline.stages.common import produce_all, training_seeds, words
from sidegan.pipeline.stages.random import random_valid
from sidegan.pipeline.tracking import Tracker
from sidegan.seeds import method_of
from sidegan.validity import check

log = logging.getLogger(__name__)

_TRIES = 1000  # batches of draws
_MANY_DRAWN = 500  # valid trajectories whose drawing tells the time of one
_FEW, _MANY = 5, 45  # steps of the two trainings whose difference tells the time of a step


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Time every way to a first set."""
    task = Task(cfg, store)
    for name, training in task.short_sets():
        make = partial(_make, task, name, training)
        produce_all(task, "first set", [plan_beyond.first_set(task, name, training)], [make])
        report = read_json(store.require(plan_beyond.first_set(task, name, training)) / REPORT)
        title = task.named(name, training)
        log.info("first set of %s: %s", title, words(report))
        tracker.log_metrics({f"first_set/{title}/{key}": value for key, value in report.items()})


def _make(task: Task, name: str, training: int, folder: Path, work: Path, report: Report) -> None:
    count = task.cfg.selection.count
    facts = {"seconds": 0.0}
    if name == RANDOM:
        facts["seconds"] = _seconds(lambda: random_valid(task, count, "first random set"))
    elif name == SEEDS:
        facts["seconds"] = _seconds(lambda: _optimised(task, count))
    else:
        path = task.store.require(task.gan(name, task.cfg.gan[name], training)) / GENERATOR
        facts["seconds"] = _seconds(lambda: _drawn(task, path, count))
        facts["each"] = _seconds(lambda: _drawn(task, path, _MANY_DRAWN)) / _MANY_DRAWN
        if task.cfg.gan[name].exact is not None:
            facts["training_seconds"] = _training_seconds(task, name)
    write_json(folder / REPORT, facts)
    report(1, 1)


def _seconds(work: Callable[[], object]) -> float:
    """CPU time of some work [s]."""
    began = time.process_time()
    work()
    return time.process_time() - began


def _optimised(task: Task, count: int) -> Tensor:
    """So many seeds and no more, (count, J, H, 2)."""
    wanted = task.cfg.seeds
    extra = {"ants": wanted.ants, "evaluations": wanted.evaluations, "reserve": wanted.reserve}
    options = {key: value for key, value in extra.items() if value is not None}
    method = method_of(wanted.method, wanted.steps, wanted.attempts, **options)
    problem = Problem(task.constraints, task.trajectory, wanted.samples, wanted.fitness == "diagonal")
    return method.optimise(problem, count, task.random("first seeds")).coefficients


def _drawn(task: Task, path: Path, count: int) -> Tensor:
    """The first valid trajectories of a generator in a file, at most (count, J, H, 2)."""
    generator = TrajectoryGenerator.load(path, task.arm)
    noise = torch.Generator().manual_seed(task.number("first set"))
    kept: list[Tensor] = []
    for _ in range(_TRIES):
        c = generator.sample(2 * count, noise)
        kept.append(c[check(task.constraints, task.trajectory, c).valid])
        if sum(map(len, kept)) >= count:
            break
    return torch.cat(kept)[:count]


def _training_seconds(task: Task, name: str) -> float:
    """CPU time of one whole training [s], from that of a few of its steps: what others do does not count."""
    from sidegan.gan.training import Run, train_variant

    wanted = task.cfg.gan[name]
    seeds = training_seeds(task).coefficients if wanted.seeded else None

    def train(steps: int) -> None:
        brief = replace(wanted, epochs=1, steps=steps)
        with TemporaryDirectory() as work:
            once = Run(name, 0, Path(work), evaluation=0)
            train_variant(brief, task.constraints, task.trajectory, seeds, once)

    few, many = (_seconds(partial(train, steps)) for steps in (_FEW, _MANY))
    steps = wanted.epochs * (wanted.steps or 1)
    return few + (steps - _FEW) * (many - few) / (_MANY - _FEW)
