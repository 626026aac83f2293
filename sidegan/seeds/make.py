"""Seed sets and long trajectories, made task by task: parallel, resumable, the same however many workers."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from sidegan.base.parallel import Report, run_jobs
from sidegan.base.storage import read_torch, write_torch
from sidegan.design.problem import Problem
from sidegan.errors import ArtifactError, ConfigError
from sidegan.seeds.gradient import Gradient
from sidegan.seeds.result import SeedBatch

_SPARE_ROUNDS = 2  # further rounds of tasks when some starts never became valid
_LONG_ROUNDS = 50
_LONG_RESERVE = 0.05  # share of each limit: nothing is to imitate a long trajectory, so it may use the rest


class Method(Protocol):
    """An optimiser of seeds."""

    def optimise(self, problem: Problem, count: int, seed: np.random.SeedSequence) -> SeedBatch:
        """Up to ``count`` valid seeds."""


@dataclass(frozen=True)
class Tasks:
    """How a seed set is cut into tasks.

    Attributes:
        count: seeds wanted.
        batch: seeds of one task.
        work: folder of the finished tasks' files, read again after an interrupt.
        workers: processes; None: one per core.
    """

    count: int
    batch: int
    work: Path
    workers: int | None = None


def make_seeds(problem: Problem, method: Method, tasks: Tasks, random: np.random.SeedSequence) -> SeedBatch:
    """Exactly ``tasks.count`` valid seeds.

    Raises:
        InfeasibleError: when too few starts become valid in three rounds of tasks; says what they violate.
    """
    problem.constraints.refuse_home(problem.trajectory.home or ())
    made: list[SeedBatch] = []
    number = 0
    for _ in range(1 + _SPARE_ROUNDS):
        missing = tasks.count - sum(map(len, made))
        if missing <= 0:
            break
        sizes = [min(tasks.batch, missing - i) for i in range(0, missing, tasks.batch)]
        jobs: list[Callable[[Report], Any]] = []
        for size in sizes:
            seed = np.random.SeedSequence(random.entropy, spawn_key=(*random.spawn_key, number))
            jobs.append(partial(_task, problem, method, size, seed, tasks.work / f"seeds-{number:05d}.pt"))
            number += 1
        made += run_jobs("seeds", jobs, tasks.workers, missing)
    whole = SeedBatch.join(made)
    if len(whole) < tasks.count:
        raise whole.shortfall(tasks.count)
    return whole


def make_long(
    problem: Problem, steps: int, seconds: float, random: np.random.SeedSequence, progress: Report
) -> SeedBatch:
    """One long trajectory: the best of as many starts as fit into the CPU time, of at least one.

    Args:
        problem: with the long family, and as many samples as its bandwidth needs.
        steps: evaluations per start.
        seconds: CPU time [s] that is used up before no further start is made.
        random: of the starts.
        progress: told (done, total) in thousandths of the time.

    Raises:
        InfeasibleError: when no start becomes valid.
    """
    began = time.process_time()
    best: SeedBatch | None = None
    tried: list[SeedBatch] = []
    for seed in random.spawn(_LONG_ROUNDS):
        found = Gradient(steps=steps, attempts=1, reserve=_LONG_RESERVE).optimise(problem, 1, seed)
        tried.append(found)
        if len(found) and (best is None or float(found.fitness[0]) < float(best.fitness[0])):
            best = found
        spent = time.process_time() - began
        progress(min(1000, round(1000 * spent / seconds)) if seconds > 0 else 1000, 1000)
        if spent >= seconds and best is not None:
            break
    whole = SeedBatch.join(tried)
    if best is None:
        raise whole.shortfall(1)
    return SeedBatch(best.coefficients, best.fitness, whole.attempts, whole.failed, whole.faults, spent)


def _task(
    problem: Problem, method: Method, count: int, seed: np.random.SeedSequence, path: Path, report: Report
) -> SeedBatch:
    try:
        batch = SeedBatch(**read_torch(path))
    except (ArtifactError, TypeError):
        batch = method.optimise(problem, count, seed)
        write_torch(path, vars(batch))
    report(1, 1)
    return batch


def method_of(name: str, steps: int, attempts: int, **options: Any) -> Method:
    """The optimiser called ``gradient`` or ``paper``; options are further fields of its class.

    Raises:
        ConfigError: for another name.
    """
    if name == "gradient":
        return Gradient(steps=steps, attempts=attempts, **options)
    if name == "paper":
        from sidegan.seeds.paper import Paper

        return Paper(generations=steps, attempts=attempts, **options)
    raise ConfigError(f"there is no seed optimiser {name!r}, expected gradient or paper")
