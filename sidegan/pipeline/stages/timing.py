"""Stage timing: the speed of a generator on this machine, with one thread."""

import os
import platform
import time
from collections.abc import Callable
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np

from sidegan.design.problem import Problem
from sidegan.pipeline.artifact import Artifact, Build
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.training import generator, load_generator

TIMED = "eigen"  # variant to time, as a representative
_BATCH = 1000
_LENGTHS = (400, 1600, 6400, 25600)  # samples per evaluation
_SHARE = 0.2  # time for the evaluations of each length, as a share of a measurement's


def timing(run: RunContext) -> Artifact:
    """Generation speed of a variant's first training; stored as costs, since it depends on the machine."""
    training = run.cfg.trainings[0]
    inputs = {"gan": generator(run, TIMED, training)}
    make = partial(_make, seconds=run.cfg.discussion.seconds)
    return run.artifact("timing", TIMED, make, {}, inputs, training=training)


def _make(run: RunContext, build: Build, seconds: float) -> None:
    network = load_generator(run, generator(run, TIMED, run.cfg.trainings[0]))
    draw = network.stream(run.number(f"timing {TIMED}"))
    generated = _rate(lambda: len(draw(_BATCH)), seconds)
    valid = _rate(lambda: int(run.cell.check(draw(_BATCH)).valid.sum()), seconds)
    build.costs["growth"] = _growth(run, _SHARE * seconds)
    build.costs |= {"generation_seconds": 1 / generated, "valid_per_second": valid}
    build.costs |= {"machine": processor(), "cores": os.cpu_count() or 1, "torch": version("torch")}


def _rate(work: Callable[[], int], seconds: float) -> float:
    """Items per second that ``work`` makes, over some seconds, after one warm-up call."""
    work()
    began = time.perf_counter()
    made = 0
    while time.perf_counter() - began < seconds:
        made += work()
    return made / (time.perf_counter() - began)


def _growth(run: RunContext, seconds: float) -> float:
    """Exponent of the time for YᵀY and its condition number as a power of the number of samples."""
    c = run.cell.problem.start(1, np.random.default_rng(0), 0.5)

    def rate(samples: int) -> float:
        problem = Problem(run.cell.constraints, run.cell.trajectory, samples)
        return _rate(lambda: len(problem.fitness(c)), seconds)

    return -float(np.polyfit(np.log(_LENGTHS), np.log([*map(rate, _LENGTHS)]), 1)[0])


def processor() -> str:
    """Name of the processor, if the system provides it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


STAGES = {"timing": Stage(lambda run: [timing(run)] if TIMED in run.cfg.gan else [])}
