"""Optimisers of seeds, their results, and the resumable parallel tasks that make a seed set."""

import json
import time
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.parallel import Job, Report, cpu_seconds, run_jobs
from sidegan.base.settings_text import FILL_IN, suggestion
from sidegan.base.storage import read_arrays, reading, write_arrays
from sidegan.design.problem import Problem
from sidegan.errors import ArtifactError, InfeasibleError
from sidegan.kernels import HOPELESS
from sidegan.validity import Constraints, summarise_faults
from sidegan.validity.remedies import remedy

_FINER = 3  # ratio of samples for the reported fitness to the problem's samples
_REACH = 0.7  # share of the tightest limit used by the first starts, and its factor per round
_ILL = "the condition number"
_SPARE_ROUNDS = 2  # additional rounds of tasks if starts fail
_SPARE_STARTS = 4  # additional starts of a long trajectory per configured one, while none is valid


@dataclass(frozen=True)
class SeedBatch:
    """Valid seeds, and statistics of their optimisation."""

    coefficients: Array  # of valid seeds [rad/s], (n, J, H, 2)
    fitness: Array  # condition numbers of YᵀY, (n,)
    attempts: int = 0  # starts that were optimised
    failed: int = 0  # starts that did not become valid seeds
    faults: dict[str, int] = field(default_factory=dict)  # number of failed starts by violation
    cpu_seconds: float = 0.0  # including failures

    def __len__(self) -> int:
        return len(self.coefficients)

    @classmethod
    def join(cls, batches: Iterable["SeedBatch"]) -> "SeedBatch":
        """All batches, at least one, joined in order."""
        parts = list(batches)
        return cls(
            np.concatenate([part.coefficients for part in parts]),
            np.concatenate([part.fitness for part in parts]),
            sum(part.attempts for part in parts),
            sum(part.failed for part in parts),
            dict(sum((Counter(part.faults) for part in parts), Counter[str]())),
            sum(part.cpu_seconds for part in parts),
        )

    @classmethod
    def read(cls, path: Path) -> "SeedBatch":
        """A batch from a file of its ``arrays``; ArtifactError if there is none."""
        arrays = read_arrays(path)
        with reading(path, "seed"):
            return cls(arrays["coefficients"], arrays["fitness"], **json.loads(arrays["origin"].item()))

    def arrays(self) -> dict[str, Array]:
        """Arrays for a file, of numbers and text."""
        numbers = {"coefficients": self.coefficients, "fitness": self.fitness}
        origin = {name: x for name, x in vars(self).items() if name not in numbers}
        return {**numbers, "origin": np.array(json.dumps(origin))}

    def best(self, count: int) -> "SeedBatch":
        """The ``count`` seeds with the least fitness, or all, in their order."""
        kept = np.sort(np.argsort(self.fitness)[:count])
        return replace(self, coefficients=self.coefficients[kept], fitness=self.fitness[kept])

    def shortfall(self, constraints: Constraints, count: int) -> InfeasibleError:
        """Error that says why there are fewer than ``count`` seeds."""
        why = summarise_faults(self.faults) or "no start was finished"
        worst, _, where = max(self.faults, key=self.faults.__getitem__, default="").partition(" of ")
        roomy = f"a home with more room around it ({suggestion('trajectory.home', [FILL_IN])})"
        slower = f"slower motion ({suggestion('trajectory.period', FILL_IN)})"
        helps = remedy(constraints, (worst, where)) if where else f"{roomy}, {slower}"
        return InfeasibleError(
            f"only {len(self)} of {count} seeds became valid in {self.attempts} starts; "
            f"of those that failed, {why}; what may help: {helps}"
        )


def ship(path: Path, stamp: Mapping[str, Any], batch: SeedBatch) -> None:
    """Write seeds that took long to make, in single precision, with a stamp of what made them."""
    seeds = replace(batch, coefficients=batch.coefficients.astype(np.float32)).arrays()
    write_arrays(path, {"stamp": np.array(json.dumps(stamp)), **seeds})


def shipped(path: Path, stamp: Mapping[str, Any], count: int) -> SeedBatch | None:
    """The first ``count`` seeds of a file by ``ship``; None if it is missing, short or has another stamp."""
    if not path.exists():
        return None
    seeds = SeedBatch.read(path)
    if json.loads(read_arrays(path)["stamp"].item()) != stamp or len(seeds) < count:
        return None
    return replace(
        seeds,
        coefficients=seeds.coefficients[:count].astype(float),
        fitness=seeds.fitness[:count],
        cpu_seconds=seeds.cpu_seconds * count / len(seeds),
    )


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
    from sidegan.design.search import prove  # imports compiled code

    c, valid, verdict = prove(problem, c, smallest)
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
        batch = SeedBatch.read(path) if path else None
    except ArtifactError:
        batch = None
    if batch is None:
        batch = method.optimise(problem, count, seed)
        if path:
            write_arrays(path, batch.arrays(), folder=False)  # without it the seeds are finished
    report(1, 1)
    return batch
