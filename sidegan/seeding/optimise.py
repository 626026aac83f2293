"""Optimisers of seeds, seed sets and long trajectories, in resumable parallel tasks."""

import time
from abc import ABC, abstractmethod
from collections import Counter
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.parallel import Job, Report, cpu_seconds, run_jobs
from sidegan.base.storage import read_arrays, write_task
from sidegan.design.problem import Problem
from sidegan.errors import ArtifactError
from sidegan.kernels import HOPELESS
from sidegan.seeding.result import SeedBatch

_FINER = 3  # ratio of samples for the reported fitness to the problem's samples
_REACH = 0.7  # share of the tightest limit used by the first starts, and its factor per round
_ILL = "the condition number"
_SPARE_ROUNDS = 2  # additional rounds of tasks if starts fail
_SPARE_STARTS = 4  # additional starts of a long trajectory per configured one, while none is valid


class Optimiser(ABC):
    """Base class of optimisers, which propose candidates; this class proves which are valid."""

    attempts: int  # most rounds of proposals
    smallest = 0.5  # factor by which a candidate may be shrunk at most to become valid

    @abstractmethod
    def propose(self, problem: Problem, count: int, reach: float, source: np.random.SeedSequence) -> Array:
        """Candidates [rad/s], (count, J, H, 2), from starts that use the share ``reach`` of the limits."""

    def optimise(self, problem: Problem, count: int, seed: np.random.SeedSequence) -> SeedBatch:
        """Up to ``count`` seeds, in rounds that replace failed candidates.

        Each round starts nearer to home than the last. Two consecutive rounds without a valid candidate end
        the search. Of surplus valid candidates the best conditioned are kept.

        Raises:
            InfeasibleError: when the arm cannot rest at home.
        """
        problem.constraints.refuse_home(problem.trajectory.home or ())
        began = time.process_time()
        missing = count
        batches = list[SeedBatch]()
        for index in range(self.attempts):
            proposed = self.propose(problem, missing, _REACH ** (index + 1), _child(seed, index))
            batches.append(settle(problem, proposed, self.smallest).best(missing))
            missing -= len(batches[-1])
            if not missing or (index and not any(map(len, batches[-2:]))):
                break
        return replace(SeedBatch.join(batches), cpu_seconds=time.process_time() - began)


def settle(problem: Problem, c: Array, smallest: float) -> SeedBatch:
    """Valid candidates [rad/s], (B, J, H, 2), shrunk towards home, to ``smallest`` at most, if that helps."""
    from sidegan.design.search import proven  # imports compiled code

    c, valid, verdict = proven(problem, c, smallest)
    fitness = replace(problem, samples=_FINER * problem.samples).fitness(c)
    good = valid & (fitness < HOPELESS)
    faults = Counter({_ILL: int((valid & ~good).sum())})
    if not valid.all():
        faults.update(verdict.faults())
    return SeedBatch(c[good], fitness[good], len(c), int((~good).sum()), dict(+faults))


def _child(seed: np.random.SeedSequence, index: int) -> np.random.SeedSequence:
    return np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, index))


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
    """``count`` valid seeds, a batch per task, whatever the number of workers.

    Files of finished tasks in ``work`` are reused.

    Raises:
        InfeasibleError: when too few seeds are valid after three rounds of tasks; says what they violate.
    """
    work.mkdir(parents=True, exist_ok=True)
    batches: list[SeedBatch] = []
    for _ in range(1 + _SPARE_ROUNDS):
        missing = count - sum(map(len, batches))
        if missing <= 0:
            break
        sizes = [min(batch, missing - i) for i in range(0, missing, batch)]
        jobs: list[Job] = [
            partial(_task, problem, method, size, _child(random, index), work / f"seeds-{index:05d}.npz")
            for index, size in enumerate(sizes, len(batches))
        ]
        batches += run_jobs("seeds", jobs, workers, missing)
    whole = SeedBatch.join(batches)
    if len(whole) < count:
        raise whole.shortfall(problem.constraints, count)
    return whole


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
    jobs: list[Job] = [partial(_task, problem, method, 1, seed, None) for seed in seeds]
    batches = run_jobs("long", jobs[:starts], workers, starts)
    for job in jobs[starts:]:
        if any(map(len, batches)):
            break
        batches += run_jobs("long", [job], workers=1, total=1)
    whole = SeedBatch.join(batches)
    if not len(whole):
        raise whole.shortfall(problem.constraints, 1)
    return replace(whole.best(1), cpu_seconds=cpu_seconds() - began)


def _task(
    problem: Problem,
    method: Optimiser,
    count: int,
    seed: np.random.SeedSequence,
    path: Path | None,
    report: Report,
) -> SeedBatch:
    """Seeds from an earlier task's file, or new ones, which are kept there; None: no file."""
    try:
        batch = SeedBatch.of(read_arrays(path)) if path else None
    except ArtifactError:
        batch = None
    if batch is None:
        batch = method.optimise(problem, count, seed)
        if path:
            write_task(path, batch.arrays())
    report(1, 1)
    return batch
