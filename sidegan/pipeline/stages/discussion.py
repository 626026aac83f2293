"""Stages density and timing: a kernel density estimate instead of the GAN; speed of a generator."""

import math
import os
import platform
import time
from collections.abc import Callable
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd

from sidegan.base.arrays import flatten
from sidegan.base.storage import write_frame
from sidegan.design.fidelity import distance_to
from sidegan.design.problem import Problem
from sidegan.errors import ConfigError
from sidegan.gan.metrics import measure_samples
from sidegan.pipeline.artifact import Artifact, Build
from sidegan.pipeline.context import RESULTS, RunContext
from sidegan.pipeline.stages import Stage
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.training import generator, load_generator, taught, training_seeds

TIMED = "eigen"  # variant to time, as a representative
_BATCH = 1000
_LENGTHS = (400, 1600, 6400, 25600)  # samples per evaluation
_SHARE = 0.2  # time for the evaluations of each length, as a share of a measurement's


def density(run: RunContext) -> Artifact:
    """Validity, fitness and diversity of samples from density estimates."""
    settings = {"bandwidths": run.cfg.discussion.bandwidths, "draws": run.cfg.discussion.draws}
    return run.artifact("density", "kde", _estimate, settings | taught(run), {"seeds": seed_set(run)})


def _estimate(run: RunContext, build: Build) -> None:
    """Sample a Gaussian kernel density estimate of the seeds at each bandwidth.

    Source: Scott 1992, Multivariate density estimation (bandwidth); the kernel has the seeds' covariance.
    """
    from scipy.stats import gaussian_kde

    seeds = training_seeds(run).coefficients
    _refuse_few(len(seeds), seeds[0].size)
    estimate = gaussian_kde(flatten(seeds, 1).T)
    rows = []
    for bandwidth in run.cfg.discussion.bandwidths:
        estimate.set_bandwidth(bandwidth * estimate.scotts_factor())
        random = np.random.default_rng(run.random(f"density {bandwidth}"))
        drawn = estimate.resample(run.cfg.discussion.draws, random)
        c = np.ascontiguousarray(drawn.T).reshape(-1, *seeds.shape[1:])
        row = {"bandwidth": bandwidth, "factor": float(estimate.factor), "from_seed": distance_to(c, seeds)}
        rows.append(row | measure_samples(run.cell.constraints, run.cell.trajectory, c, seeds))
    write_frame(build.folder / RESULTS, pd.DataFrame(rows))


def _refuse_few(seeds: int, coefficients: int) -> None:
    """Refuse a density estimate whose covariance would be singular by a ConfigError."""
    if seeds <= coefficients:
        raise ConfigError(
            f"a density estimate of {coefficients} coefficients needs more than that many seeds, not {seeds}"
        )


def _check_density(run: RunContext) -> None:
    _refuse_few(run.cfg.subset or run.cfg.seeds.count, math.prod(run.cell.trajectory.shape))


def timing(run: RunContext) -> Artifact:
    """Generation speed of a variant's first training; stored as costs, since it depends on the machine."""
    training = run.cfg.trainings[0]
    inputs = {"gan": generator(run, TIMED, training)}
    make = partial(_measure_speed, seconds=run.cfg.discussion.seconds)
    return run.artifact("timing", TIMED, make, {}, inputs, training=training, alone=True)


def _measure_speed(run: RunContext, build: Build, seconds: float) -> None:
    """Measure on this machine, with one thread."""
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
    info = Path("/proc/cpuinfo")  # of Linux
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


STAGES = {
    "density": Stage(lambda run: [density(run)], check=_check_density),
    "timing": Stage(lambda run: [timing(run)] if TIMED in run.cfg.gan else []),
}
