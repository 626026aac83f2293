"""Stage replication: identification from whole sets measured with noise, the seeds repeatedly."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import partial, reduce
from pathlib import Path

import numpy as np
import pandas as pd

from sidegan.base.parallel import Report
from sidegan.base.storage import read_arrays, readable, write_arrays, write_frame
from sidegan.identification import Noise
from sidegan.identification.settings import Reading
from sidegan.identification.study import combined_errors, measured_sums
from sidegan.identification.sums import Sums
from sidegan.pipeline.artifact import Artifact, Build, Metrics
from sidegan.pipeline.context import FACTS, RESULTS, RunContext
from sidegan.pipeline.stages import Stage
from sidegan.pipeline.stages.baselines import random_set, test_trajectories
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.selection import RANDOM, SEEDS, Pool, whole_sets

SUMS = "sums.npz"
COPIES = "copies"  # the seeds once more, measured as generated trajectories are
CONTROLS = (RANDOM, COPIES)  # which any set of generated trajectories should beat
FITTED = 0.44, 10**-1.8  # p₀ and s fitted to the norms in the paper's Table III


@dataclass(frozen=True)
class Replication:
    """How a whole set is measured."""

    noise: Noise
    repeats: int  # noise realisations; 1 if nothing is noisy
    replicas: int  # measurements in each realisation; more than 1 only for the seeds

    @classmethod
    def of(cls, run: RunContext, pool: Pool, reading: Reading) -> "Replication":
        """How a reading measures a set."""
        settings = run.cfg.replication
        if pool.name == SEEDS:
            return cls(settings.of_seeds(reading), settings.repeats, max(settings.replicas))
        noise = settings.of_generated(reading)
        return cls(noise, 1 if noise.exact else settings.draws(reading), 1)


def compared_sets(run: RunContext) -> list[Pool]:
    """The seeds, each generator's library, and the controls."""
    controls = {RANDOM: random_set(run), COPIES: seed_set(run)}
    return [*whole_sets(run), *(Pool(name, None, (made,)) for name, made in controls.items())]


def regression_sums(run: RunContext, pool: Pool, reading: Reading) -> Artifact:
    """Sums over the measurements of a whole set; readings that measure it the same way share them."""
    measured = Replication.of(run, pool, reading)
    settings = asdict(measured) | {"rate": run.cfg.identification.rate}
    label = pool.name
    if measured.noise.exact:
        label += "-exact"
    elif not (measured.noise.state and measured.noise.torque):
        label += "-states" if measured.noise.state else "-torques"
    make = partial(_measure, pool=pool, measured=measured)
    return run.artifact("sums", label, make, settings, pool.inputs, training=pool.training)


def replication(run: RunContext, reading: Reading) -> Artifact:
    """Errors of identification from each combination of whole sets, under a reading."""
    inputs = {
        f"{pool.name} {pool.training or 0}": regression_sums(run, pool, reading)
        for pool in compared_sets(run)
    }
    settings = asdict(run.cfg.identification) | asdict(run.cfg.replication)
    settings |= {"repeats": run.cfg.replication.draws(reading), "reading": reading}
    del settings["readings"], settings["others"]
    label, title = "-".join([*run.cfg.gan, reading]), f"replication {reading}"
    make = partial(_combine, reading=reading)
    return run.artifact("replication", label, make, settings, inputs, title=title, metrics=_mean_errors)


def draws(run: RunContext, pool: Pool, reading: Reading) -> list[list[Sums]]:
    """Sums over a whole set by noise realisation and replica."""
    found = _read(run.store.require(regression_sums(run, pool, reading)) / SUMS)
    replicas = Replication.of(run, pool, reading).replicas
    repeats = [found[i : i + replicas] for i in range(0, len(found), replicas)]
    return repeats * (run.cfg.replication.repeats if len(repeats) == 1 else 1)


def _mean_errors(folder: Path) -> Metrics:
    frame = pd.read_parquet(folder / RESULTS)
    mean = frame[~frame.weighted].groupby("set").nmse.mean()
    return {f"{name}/nmse": float(value) for name, value in mean.items()}


def _measure(run: RunContext, build: Build, pool: Pool, measured: Replication) -> None:
    """Compute the sums for every realisation and replica, in resumable jobs."""
    coefficients = pool.load(run).coefficients
    settings = replace(run.cfg.identification, noise=measured.noise)
    replicas = [(r, k) for r in range(measured.repeats) for k in range(measured.replicas)]
    # Without noise on states all draws share the regressor, in one job.
    jobs = [[replica] for replica in replicas] if measured.noise.state else [replicas]
    found = list[Sums]()
    for done, job in enumerate(jobs):
        path = build.work / f"{done}.npz"
        if not readable(path):
            randoms = [run.random(f"measured {pool.name} {r} {k}", pool.training) for r, k in job]
            family = run.cell.trajectory, coefficients
            report = partial(_report_part, build.report, done, len(jobs))
            _write(path, measured_sums(run.cell.body, family, settings, randoms, report))
        found += _read(path)
        build.report(done + 1, len(jobs))
    _write(build.folder / SUMS, found)


def _write(path: Path, draws: list[Sums]) -> None:
    write_arrays(path, {name: np.stack(x) for name, x in zip(Sums._fields, zip(*draws))})


def _read(path: Path) -> list[Sums]:
    arrays = read_arrays(path)
    return [Sums(*draw) for draw in zip(*(arrays[name] for name in Sums._fields))]


def _report_part(report: Report, before: int, total: int, done: int, count: int) -> None:
    report(before * count + done, total * count)


def _combine(run: RunContext, build: Build, reading: Reading) -> None:
    settings = run.cfg.replication
    tests = (run.cell.trajectory, test_trajectories(run))
    study = replace(run.cfg.identification, noise=settings.of_seeds(reading))
    seeds, *others = ((pool, draws(run, pool, reading)) for pool in compared_sets(run))
    tables: list[tuple[pd.DataFrame, ...]] = []
    for repeat in range(settings.draws(reading)):
        first = seeds[1][repeat]
        fixed = {pool.name: [first[0], *parts[repeat]] for pool, parts in others if pool.training is None}
        jobs = [(0, {f"{SEEDS} ×{k}": first[:k] for k in settings.replicas} | fixed)]
        for training in run.cfg.trainings:
            of_training = [(pool, parts) for pool, parts in others if pool.training == training]
            jobs.append((training, {pool.name: [first[0], *parts[repeat]] for pool, parts in of_training}))
        for training, sets in jobs:
            errors, facts = combined_errors(run.cell.body, sets, tests, study)
            fitted = {name: _fitted_norm(reduce(Sums.plus, x), first[0]) for name, x in sets.items()}
            facts["fitted_norm"] = facts["set"].map(fitted)
            tables.append(tuple(x.assign(training=training, repeat=repeat) for x in (errors, facts)))
    for file, part in zip((RESULTS, FACTS), zip(*tables)):
        write_frame(build.folder / file, pd.concat(part, ignore_index=True))


def _fitted_norm(sums: Sums, seeds: Sums) -> float:
    """‖diag (s Σ + I/p₀)⁻¹‖ with p₀ and s of FITTED; Σ is the information per sample of the seeds."""
    prior, scale = FITTED
    information = sums.information.sum(0) / seeds.weight
    total = scale * information + np.eye(len(information)) / prior
    return float(np.linalg.norm(np.linalg.inv(total).diagonal()))


def _replications(run: RunContext) -> Iterator[Artifact]:
    yield random_set(run)
    for reading in run.cfg.replication.readings:
        yield from (regression_sums(run, pool, reading) for pool in compared_sets(run))
        yield replication(run, reading)


STAGES = {"replication": Stage(_replications)}
