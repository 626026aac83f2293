"""Seed sets and long trajectories, made in resumable parallel tasks, whatever the number of workers."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from sidegan.base.parallel import Job, Report, cpu_seconds, run_jobs
from sidegan.base.storage import read_arrays, write_arrays
from sidegan.design.problem import Problem
from sidegan.errors import ArtifactError
from sidegan.seeding.result import Optimiser, SeedBatch

_SPARE_ROUNDS = 2  # additional rounds of tasks if starts fail
_SPARE_STARTS = 4  # additional starts of a long trajectory per configured one, while none is valid


def make_seeds(
    problem: Problem,
    method: Optimiser,
    count: int,
    random: np.random.SeedSequence,
    *,
    batch: int,
    work: Path,
    workers: int | None = None,
) -> SeedBatch:
    """``count`` valid seeds, a batch per task; files of finished tasks in ``work`` are reused.

    Raises:
        InfeasibleError: when too few seeds are valid after three rounds of tasks; says what they violate.
    """
    work.mkdir(parents=True, exist_ok=True)
    batches: list[SeedBatch] = []
    for _ in range(1 + _SPARE_ROUNDS):
        missing = count - sum(map(len, batches))
        number = len(batches)
        if missing <= 0:
            break
        sizes = [min(batch, missing - i) for i in range(0, missing, batch)]
        jobs: list[Job] = []
        for index, size in enumerate(sizes, number):
            seed = np.random.SeedSequence(random.entropy, spawn_key=(*random.spawn_key, index))
            jobs.append(partial(_task, problem, method, size, seed, work / f"seeds-{index:05d}.npz"))
        batches += run_jobs("seeds", jobs, workers, missing)
    whole = SeedBatch.join(batches)
    if len(whole) < count:
        raise whole.shortfall(problem.constraints, count)
    return whole


def _task(
    problem: Problem, method: Optimiser, count: int, seed: np.random.SeedSequence, path: Path, report: Report
) -> SeedBatch:
    try:
        batch = SeedBatch.of(read_arrays(path))
    except ArtifactError:
        batch = method.optimise(problem, count, seed)
        write_arrays(path, batch.arrays(), folder=False)  # without it the seeds are finished: no late task
    report(1, 1)
    return batch


def make_long(
    problem: Problem,
    method: Optimiser,
    starts: int,
    random: np.random.SeedSequence,
    workers: int | None = None,
) -> SeedBatch:
    """A long trajectory, the best of ``starts`` starts, or of more while none is valid.

    The method should have a single attempt; each start has its own random numbers.

    Raises:
        InfeasibleError: when no start becomes valid.
    """
    began = cpu_seconds()
    seeds = random.spawn((1 + _SPARE_STARTS) * starts)
    jobs: list[Job] = [partial(_start, problem, method, seed) for seed in seeds]
    batches = run_jobs("long", jobs[:starts], workers, starts)
    for job in jobs[starts:]:
        if any(map(len, batches)):
            break
        batches += run_jobs("long", [job], workers=1, total=1)
    whole = SeedBatch.join(batches)
    if not len(whole):
        raise whole.shortfall(problem.constraints, 1)
    return replace(whole.best(1), cpu_seconds=cpu_seconds() - began)


def _start(problem: Problem, method: Optimiser, seed: np.random.SeedSequence, report: Report) -> SeedBatch:
    batch = method.optimise(problem, 1, seed)
    report(1, 1)
    return batch
