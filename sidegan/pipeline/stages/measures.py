"""Stage measures: how well each set identifies the arm, and how similar it is to the seeds.

The error is that of identification from random draws of a set, expected on the test trajectories; unlike a
pick, a draw does not favour the set's best. Similarity is to one half of the seeds; the seeds' own is that of
the other half.
"""

from collections.abc import Iterator
from functools import partial

import numpy as np
import pandas as pd

from sidegan.base.arrays import Array, geometric_mean
from sidegan.base.storage import write_json, write_parquet
from sidegan.design.prediction import TOGETHER, TorqueNoise, torque_size
from sidegan.library.measure import likeness
from sidegan.pipeline.artifact import Artifact, Build
from sidegan.pipeline.context import REPORT, RESULTS, RunContext
from sidegan.pipeline.stage import Stage, finite
from sidegan.pipeline.stages.baselines import baselines, prediction
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.selection import SEEDS, Pool, whole_sets
from sidegan.report.tables import arrow

_SMALLEST = 1e-6  # lower bound of a joint's torque, as a share of the largest joint's


def pools(run: RunContext) -> list[Pool]:
    """The sets to measure: the baselines, the seeds, and each generator's library."""
    return [*(Pool(name, None, (made,)) for name, made in baselines(run).items()), *whole_sets(run)]


def measures(run: RunContext, pool: Pool) -> Artifact:
    """Expected errors of random draws from a pool, and its similarity to the seeds."""
    study = run.cfg.identification
    settings = {key: getattr(study, key) for key in ("rate", "prior", "constant", "tests", "reach")}
    settings |= {"level": _level(run), "together": together(run)}
    inputs = {"seeds": seed_set(run), **({} if pool.name == SEEDS else pool.inputs)}
    make = partial(_make, pool=pool)
    return run.artifact("measures", pool.name, make, settings, inputs, training=pool.training)


def together(run: RunContext) -> int:
    """Number of trajectories in a draw."""
    return run.cfg.selection.count if run.cfg.has("selection") else TOGETHER


def _level(run: RunContext) -> float:
    """Relative noise of measured torques."""
    noise = run.cfg.identification.noise
    return noise.level if noise.torque else 0.0


def _noises(run: RunContext, c: Array) -> Iterator[tuple[str, TorqueNoise]]:
    """Name of each error with its torque noise and weights of joints."""
    size = torque_size(run.cell.body, run.cell.trajectory, c)
    size = np.maximum(size, _SMALLEST * size.max())
    yield "error", TorqueNoise.proportional(_level(run), np.ones_like(size))
    yield "error_weighted", TorqueNoise.proportional(_level(run), 1 / size)
    yield "error_constant", TorqueNoise.constant(run.cell.body, run.cfg.identification.constant)


def _make(run: RunContext, build: Build, pool: Pool) -> None:
    library = pool.load(run)
    seeds = run.load(seed_set(run))
    count = together(run)
    reference, others = (seeds.take(range(k, len(seeds), 2)) for k in (0, 1))
    compared = others if pool.name == SEEDS else library
    report = likeness(compared, reference) if min(len(compared), len(reference)) > 1 else {}
    frames = list[pd.DataFrame]()
    random = run.number("draws")
    for name, noise in _noises(run, library.coefficients):
        errors = np.full((1, 1), np.nan)
        if len(library) >= count:
            errors = prediction(run, noise).of_draws(library.coefficients, count, seed=random)
        mean = errors.mean(1)
        geometric = np.exp(np.log(errors).mean(1))
        frames.append(pd.DataFrame({"noise": name, "nmse": mean, "geometric": geometric}))
        report |= {name: float(mean.mean()), f"{name}_geometric": geometric_mean(geometric)}
    rows = pd.concat(frames).assign(set=pool.name, training=pool.training or 0)
    write_parquet(build.folder / RESULTS, arrow(rows))
    write_json(build.folder / REPORT, finite(report))


STAGES = {"measures": Stage(lambda run: [measures(run, pool) for pool in pools(run)])}
