"""Benchmark of the seeds: CPU time of a valid seed, beside the paper's optimiser at a small budget."""

import numpy as np
import torch

from benchmarks.setting import Setting
from benchmarks.timing import Result, Timing, medians
from sidegan.seeds.gradient import Gradient
from sidegan.seeds.paper import ConditionProblem, Paper
from sidegan.seeds.result import SeedBatch

_COUNT = 50
_PAPER_SECONDS = 360.0  # per seed
_FULL = Paper(100, 100, 20_000, attempts=5)  # the paper's optimiser at its configured budget
_SMALL, _QUICK = Paper(20, 50, 1000, attempts=1), Paper(2, 10, 20, attempts=1)


def seeds(setting: Setting) -> Result:
    """CPU seconds per valid seed of the default optimiser on one thread, failures and checks included."""
    ours = Gradient(20 if setting.quick else 200, attempts=5, reserve=0.2)
    random = np.random.SeedSequence(0)
    batch = ours.optimise(setting.problem, setting.size(_COUNT), random)
    small = (_QUICK if setting.quick else _SMALL).optimise(setting.problem, 1, random)
    together, alone = _costs(setting)
    return Result(
        Timing(batch.cpu_seconds, batch.cpu_seconds),
        1 / max(1, len(batch)),
        _FULL.generations * _FULL.ants * together + _FULL.evaluations * alone,
        also={
            "the paper": _PAPER_SECONDS,
            f"median condition number of our {len(batch)}": _median(batch),
            f"gaco + compass search at a small budget, {small.cpu_seconds:.0f} s": _median(small),
        },
    )


def _costs(setting: Setting) -> tuple[float, float]:
    """CPU seconds of an evaluation in the colony's batch, and of one alone."""
    paper = ConditionProblem(setting.problem)
    x = np.random.default_rng(0).uniform(-1, 1, (_FULL.ants, paper.range.size))
    batch, one = medians(setting.repeats, lambda: paper.batch_fitness(x.ravel()), lambda: paper.fitness(x[0]))
    return batch.cpu / len(x), one.cpu


def _median(batch: SeedBatch) -> float | str:
    return float(torch.median(batch.fitness)) if len(batch) else "none became valid"
