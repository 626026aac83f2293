"""Stages measures and variations: how well each set identifies an arm, and how similar it is to the seeds.

The error is that of identification from random draws of a set, expected on the test trajectories; unlike a
pick, a draw does not favour the set's best. Similarity is to one half of the seeds; the seeds' own is that of
the other half. Stage variations makes all this, and what it needs, for several arms or changes of settings.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

from sidegan.base.arrays import geometric_mean
from sidegan.base.storage import finite, write_frame, write_json
from sidegan.design.prediction import TOGETHER, TorqueNoise, torque_size
from sidegan.errors import ConfigError
from sidegan.library.measure import likeness
from sidegan.pipeline.artifact import Artifact, Build
from sidegan.pipeline.context import REPORT, RESULTS, RunContext
from sidegan.pipeline.stages import Stage, stage
from sidegan.pipeline.stages.baselines import baselines, predicted, prediction
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.selection import SEEDS, Pool, whole_sets

_OF_EACH = ("seeds", "surrogates", "gan", "library", "random", "measures")  # stages of each variation
_SMALLEST = 1e-6  # lower bound of a joint's torque, as a share of the largest joint's


def measured_pools(run: RunContext) -> list[Pool]:
    """The sets to measure: the baselines, the seeds, and each generator's library."""
    return [*(Pool(name, None, (made,)) for name, made in baselines(run).items()), *whole_sets(run)]


def measures(run: RunContext, pool: Pool) -> Artifact:
    """Expected errors of random draws from a pool, and its similarity to the seeds."""
    study = run.cfg.identification
    level = study.noise.level if study.noise.torque else 0.0  # relative noise of measured torques
    settings = {**predicted(run), "level": level, "together": together(run)}
    inputs = {"seeds": seed_set(run), **({} if pool.name == SEEDS else pool.inputs)}
    make = partial(_make, pool=pool, level=level)
    return run.artifact("measures", pool.name, make, settings, inputs, training=pool.training)


def together(run: RunContext) -> int:
    """Number of trajectories in a draw."""
    return run.cfg.selection.count if run.cfg.has("selection") else TOGETHER


def _make(run: RunContext, build: Build, pool: Pool, level: float) -> None:
    library, seeds = pool.load(run), run.load(seed_set(run))
    count, body = together(run), run.cell.body
    reference, others = (seeds.take(range(k, len(seeds), 2)) for k in (0, 1))
    compared = others if pool.name == SEEDS else library
    report = likeness(compared, reference) if min(len(compared), len(reference)) > 1 else {}
    size = torque_size(body, run.cell.trajectory, library.coefficients)
    size = np.maximum(size, _SMALLEST * size.max())
    noises = {
        "error": TorqueNoise.proportional(level, np.ones_like(size)),
        "error_weighted": TorqueNoise.proportional(level, 1 / size),
        "error_constant": TorqueNoise.constant(body, run.cfg.identification.constant),
    }
    frames = list[pd.DataFrame]()
    random = run.number("draws")
    for name, noise in noises.items():
        errors = np.full((1, 1), np.nan)
        if len(library) >= count:
            errors = prediction(run, noise).of_draws(library.coefficients, count, seed=random)
        mean = errors.mean(1)
        geometric = np.exp(np.log(errors).mean(1))
        frames.append(pd.DataFrame({"noise": name, "nmse": mean, "geometric": geometric}))
        report |= {name: float(mean.mean()), f"{name}_geometric": geometric_mean(geometric)}
    rows = pd.concat(frames).assign(set=pool.name, training=pool.training or 0)
    write_frame(build.folder / RESULTS, rows)
    write_json(build.folder / REPORT, finite(report))


def variations(run: RunContext) -> dict[str, RunContext]:
    """The run with each of the changes that it compares, by name: other arms, or other settings."""
    rows = run.cfg.rows if run.cfg.has("rows") else {name: [f"robot={name}"] for name in run.cfg.arms}
    made = {}
    for name, changes in rows.items():
        try:
            made[name] = run.with_changes(*changes)
        except ConfigError as error:
            raise ConfigError(f"{name}: {error}") from error
    return made


def _varied(run: RunContext) -> Iterator[Artifact]:
    seen = set[str]()
    for name, other in variations(run).items():
        for part in map(stage, _OF_EACH):
            for artifact in part.artifacts(other):
                if artifact.digest not in seen:
                    seen.add(artifact.digest)
                    yield replace(artifact, title=f"{name} {artifact.title}")


def _check_varied(run: RunContext) -> None:
    for other in variations(run).values():
        _ = other.cell.constraints
        for part in map(stage, _OF_EACH):
            part.check(other)


STAGES = {
    "measures": Stage(lambda run: [measures(run, pool) for pool in measured_pools(run)]),
    "variations": Stage(_varied, check=_check_varied),
}
