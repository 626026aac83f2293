"""Stage timing: how fast the generators are on this machine, one thread."""

import os
import platform
import time
from collections.abc import Callable
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np

from sidegan.base.extras import extra
from sidegan.design.problem import Problem
from sidegan.pipeline.artifact import Artifact, Build
from sidegan.pipeline.context import GENERATOR, RunContext
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.training import generator

_BATCH = 1000
_SECONDS = 3.0  # [s] of every measurement
_LENGTHS = (400, 1600, 6400, 25600)  # samples of one evaluation


def timing(run: RunContext, name: str) -> Artifact:
    """The speed of the first training of a variant; its numbers are costs, as they are the machine's."""
    training = run.cfg.trainings[0]
    inputs = {"gan": generator(run, name, training)}
    make = partial(_make, name=name)
    return run.artifact("timing", name, make, {}, inputs, training=training)


def _make(run: RunContext, build: Build, name: str) -> None:
    with extra("paper"):
        from sidegan.gan.generator import TrajectoryGenerator

    path = run.store.require(generator(run, name, run.cfg.trainings[0])) / GENERATOR
    network = TrajectoryGenerator.load(path, run.cell.arm)
    draw = network.stream(run.number(f"timing {name}"))
    generated = _rate(lambda: len(draw(_BATCH)))
    valid = _rate(lambda: int(run.cell.check(draw(_BATCH)).valid.sum()))
    build.costs["growth"] = _growth(run)
    build.costs |= {"generation_seconds": 1 / generated, "valid_per_second": valid}
    build.costs |= {"machine": _processor(), "cores": os.cpu_count() or 1, "torch": version("torch")}


def _rate(work: Callable[[], int], share: float = 1.0) -> float:
    """Things per second that ``work`` makes, over a share of a few seconds of it, the first one left out."""
    work()
    began, made = time.perf_counter(), 0
    while time.perf_counter() - began < share * _SECONDS:
        made += work()
    return made / (time.perf_counter() - began)


def _growth(run: RunContext) -> float:
    """Exponent with which the time of YᵀY and its condition number grows with the number of samples."""
    c = run.cell.problem.start(1, np.random.default_rng(0), 0.5)

    def seconds(samples: int) -> float:
        problem = Problem(run.cell.constraints, run.cell.trajectory, samples)
        return 1 / _rate(lambda: len(problem.fitness(c)), 0.2)

    return float(np.polyfit(np.log(_LENGTHS), np.log([*map(seconds, _LENGTHS)]), 1)[0])


def _processor() -> str:
    """Name of the processor, as far as the system tells."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


STAGES = {"timing": Stage(lambda run: [timing(run, name) for name in run.cfg.gan])}
