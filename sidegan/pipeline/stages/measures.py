"""Stage measures: what the trajectories of each set are worth, and how they are like the seeds.

Worth is the expected error of identification from random draws of a set, on the test trajectories: a pick can
have more of a set's best, a draw cannot. Likeness is that with one half of the seeds; theirs is the other's.
"""

from collections.abc import Iterator
from functools import partial

import numpy as np
import pandas as pd

from sidegan.base.arrays import Array
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

_SMALLEST = 1e-6  # of the largest joint's torque, that a joint's counts as at least


def pools(run: RunContext) -> list[Pool]:
    """What is measured: the baselines, the seeds, and what each generator made alone."""
    beside = [Pool(name, None, (one,)) for name, one in baselines(run).items()]
    return [*beside, *whole_sets(run)]


def measures(run: RunContext, pool: Pool) -> Artifact:
    """Errors expected of random draws of a pool, and its likeness with the seeds."""
    study = run.cfg.identification
    settings = {key: getattr(study, key) for key in ("rate", "prior", "constant", "tests", "reach")}
    settings |= {"level": _level(run), "together": _together(run)}
    inputs = {"seeds": seed_set(run), **({} if pool.name == SEEDS else pool.inputs)}
    make = partial(_make, pool=pool)
    return run.artifact("measures", pool.name, make, settings, inputs, training=pool.training)


def _together(run: RunContext) -> int:
    """How many trajectories a set has."""
    return run.cfg.selection.count if run.cfg.has("selection") else TOGETHER


def _level(run: RunContext) -> float:
    """Noise of measured torques, as a share of them."""
    noise = run.cfg.identification.noise
    return noise.level if noise.torque else 0.0


def _noises(run: RunContext, c: Array) -> Iterator[tuple[str, TorqueNoise]]:
    """Noise on torques, and how joints are weighted against it, by the names of the errors."""
    size = torque_size(run.cell.body, run.cell.trajectory, c)
    size = np.maximum(size, _SMALLEST * size.max())
    yield "error", TorqueNoise.proportional(_level(run), np.ones_like(size))
    yield "error_weighted", TorqueNoise.proportional(_level(run), 1 / size)
    yield "error_constant", TorqueNoise.constant(run.cell.body, run.cfg.identification.constant)


def _make(run: RunContext, build: Build, pool: Pool) -> None:
    own, seeds, together = pool.load(run), run.load(seed_set(run)), _together(run)
    reference, others = (seeds.take(range(k, len(seeds), 2)) for k in (0, 1))
    compared = others if pool.name == SEEDS else own
    report = likeness(compared, reference) if min(len(compared), len(reference)) > 1 else {}
    frames, random = list[pd.DataFrame](), run.number("draws")
    for name, noise in _noises(run, own.coefficients):
        errors = np.full((1, 1), np.nan)
        if len(own) >= together:
            errors = prediction(run, noise).of_draws(own.coefficients, together, seed=random)
        mean, geometric = errors.mean(1), np.exp(np.log(errors).mean(1))
        frames.append(pd.DataFrame({"noise": name, "nmse": mean, "geometric": geometric}))
        report |= {name: float(mean.mean()), f"{name}_geometric": float(np.exp(np.log(geometric).mean()))}
    rows = pd.concat(frames).assign(set=pool.name, training=pool.training or 0)
    write_parquet(build.folder / RESULTS, arrow(rows))
    write_json(build.folder / REPORT, finite(report))


STAGES = {"measures": Stage(lambda run: [measures(run, pool) for pool in pools(run)])}
