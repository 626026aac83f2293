"""Benchmarks of the seeds: what a valid one costs by each optimiser, and an evaluation of the paper's."""

from dataclasses import replace

import numpy as np
import torch

from benchmarks.setting import Setting
from benchmarks.timing import Result, Timing, medians
from sidegan.design.problem import Problem
from sidegan.designer import Compiled
from sidegan.seeds.gradient import Gradient
from sidegan.seeds.paper import ConditionProblem, Paper
from sidegan.seeds.result import SeedBatch
from sidegan.validity import Constraints

_COUNT = 50
_PAPER_COUNT = 10
_PAPER_SECONDS = 360.0  # per seed
_SET, _STEPS, _RESERVE = 35, 60, 0.05  # seeds of a set, evaluations of each, share of limits kept free
_SAMPLES = 40
_PLAIN = 10  # evaluations by plain torch
_FULL = Paper(100, 100, 10_000, attempts=5)  # the paper's optimiser at its configured budget
_QUICK = Paper(2, 10, 20, attempts=1)


def seeds(setting: Setting) -> Result:
    """CPU seconds per valid seed of the default optimiser on one thread, failures and checks included."""
    ours = Gradient(20 if setting.quick else 200, attempts=5, reserve=0.2)
    random = np.random.SeedSequence(0)
    batch = ours.optimise(setting.problem, setting.size(_COUNT), random)
    theirs = (_QUICK if setting.quick else _FULL).optimise(setting.problem, 1, random)
    return Result(
        Timing(batch.cpu_seconds, batch.cpu_seconds),
        1 / max(1, len(batch)),
        theirs.cpu_seconds,
        also={
            "the paper": _PAPER_SECONDS,
            f"median condition number of our {len(batch)}": _median(batch),
            "condition number of the one by gaco + compass search": _median(theirs),
        },
    )


def set_of_35(setting: Setting) -> Result:
    """Wall seconds of 35 valid seeds on two threads of a warm process, beside the batched optimiser."""
    steps, count = (10 if setting.quick else _STEPS), setting.size(_SET)
    ours, theirs = Compiled(steps, 5, _RESERVE, threads=2), Gradient(steps, 5, _RESERVE)
    problem, random = setting.problem, np.random.SeedSequence(0)
    coarse = replace(problem, samples=_SAMPLES)
    run, batch = medians(
        setting.repeats,
        lambda: ours.optimise(coarse, count, random),
        lambda: theirs.optimise(problem, count, random),
    )
    many = setting.size(5 * _SET)  # a median that does not hang on a few starts
    also: dict[str, float | str] = {
        "half of our CPU time": run.cpu / 2,
        "half of the batch's CPU time": batch.cpu / 2,
        "median condition number of ours": _median(ours.optimise(coarse, many, random)),
        "of the batch's": _median(theirs.optimise(problem, many, random)),
    }
    return Result(run, 1.0, batch.wall, also)


def paper_seeds(setting: Setting) -> Result:
    """CPU seconds per valid seed of the paper's optimiser under the paper's constraints, checks included."""
    method = _QUICK if setting.quick else _FULL
    eigenvalue, diagonal = (
        method.optimise(problem, setting.size(_PAPER_COUNT), np.random.SeedSequence(0))
        for problem in (_free(setting.problem), replace(_free(setting.problem), diagonal=True))
    )
    return Result(
        Timing(eigenvalue.cpu_seconds, eigenvalue.cpu_seconds),
        1 / max(1, len(eigenvalue)),
        _PAPER_SECONDS,
        also={
            f"median condition number of {len(eigenvalue)}": _median(eigenvalue),
            "starts that failed": float(eigenvalue.failed),
            "with the diagonal fitness": diagonal.cpu_seconds / max(1, len(diagonal)),
            f"its median over {len(diagonal)}": _median(diagonal),
        },
    )


def evaluation(setting: Setting) -> Result:
    """Evaluations/s that the paper's optimiser asks one by one, beside plain torch."""
    one = ConditionProblem(_free(setting.problem))
    ratio = ConditionProblem(replace(_free(setting.problem), diagonal=True))
    x = np.random.default_rng(0).uniform(-1, 1, (setting.size(1000), one.range.size))
    few = x[:_PLAIN].reshape(-1, 1, *one.range.shape) * one.range
    run, theirs, batch, diagonal = medians(
        setting.repeats,
        lambda: [one.fitness(each) for each in x],
        lambda: [one.evaluation.plain(each) for each in few],
        lambda: one.batch_fitness(x.ravel()),
        lambda: [ratio.fitness(each) for each in x],
    )
    also: dict[str, float | str] = {
        "ours, a colony at a time": len(x) / batch.wall,
        "ours, of the diagonal fitness": len(x) / diagonal.wall,
    }
    return Result(run, len(x), len(few) / theirs.wall, also)


def _free(problem: Problem) -> Problem:
    """The same without torque limits, as in the paper."""
    constraints = problem.constraints
    return replace(problem, constraints=Constraints(constraints.arm, constraints.regions, torque=False))


def _median(batch: SeedBatch) -> float | str:
    return float(torch.median(batch.fitness)) if len(batch) else "none became valid"
