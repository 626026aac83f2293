"""Frames from a run's artifacts; only this module of the experiments opens artifacts."""

import math
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from sidegan.gan.metrics import measure_samples
from sidegan.library import Library
from sidegan.pipeline.artifact import Artifact
from sidegan.pipeline.context import EXPECTED, FACTS, RESULTS, RunContext
from sidegan.pipeline.settings import Config
from sidegan.pipeline.stages.baselines import baselines, long_trajectory, random_set
from sidegan.pipeline.stages.discussion import density, timing
from sidegan.pipeline.stages.identification import identification, plant
from sidegan.pipeline.stages.measures import measured_pools, measures
from sidegan.pipeline.stages.replication import replication
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.selection import (
    SEEDS,
    ExcitationSet,
    excitation_sets,
    generated_alone,
    library,
    picked,
    pools,
    selection,
)
from sidegan.pipeline.stages.training import generator, generators, on_subset, surrogate_networks

Report = dict[str, Any]


@dataclass(frozen=True)
class Artifacts:
    """Results of a run, read when they are first needed; an ArtifactError where one does not exist."""

    run: RunContext

    @cached_property
    def expected(self) -> pd.DataFrame:
        """Expected NMSE of every excitation set over the noise, by set, training, weighted and joint."""
        return self._expected("paper")

    @cached_property
    def constant(self) -> pd.DataFrame:
        """The same under constant noise, weighted."""
        return self._expected("constant")

    @cached_property
    def alone(self) -> pd.DataFrame:
        """The expected NMSE of the sets picked from each generator's trajectories alone."""
        return self._expected("paper", picked(self.run, generated_alone(self.run)))

    @cached_property
    def draws(self) -> pd.DataFrame:
        """Expected NMSE of random draws from every measured set, by set, training and noise."""
        return pd.concat(map(self.run.frame, self._measures.values()))

    @cached_property
    def plant(self) -> pd.DataFrame:
        """NMSE of every excitation set executed by plants, by set, training, repeat, weighted and joint."""
        return self._of_sets(plant)

    @cached_property
    def whole_errors(self) -> pd.DataFrame:
        """Experiment 2, first reading: NMSE by set, training, repeat, weighted and joint."""
        return self._replicated(0)

    @cached_property
    def whole_facts(self) -> pd.DataFrame:
        """Norms and samples of the same."""
        return self._replicated(0, FACTS)

    @cached_property
    def density(self) -> pd.DataFrame:
        """Samples of kernel density estimates, a row for each bandwidth."""
        return self.run.frame(density(self.run))

    @cached_property
    def seeds(self) -> Report:
        """Report of the seeds, with its costs."""
        return self.report(seed_set(self.run))

    @cached_property
    def random(self) -> Report:
        """Report of the random set, with its costs."""
        return self.report(random_set(self.run))

    @cached_property
    def surrogates(self) -> Report:
        """Report of the surrogates, with its costs."""
        return self.report(surrogate_networks(self.run))

    @cached_property
    def speed(self) -> Report:
        """Speed of generation, by the eigen variant's first training, and the machine."""
        return self.costs(timing(self.run))

    @property
    def valid_seconds(self) -> float:
        """Time of a generated trajectory that the check finds valid [s]; infinite if none was."""
        rate = float(self.speed["valid_per_second"])
        return 1 / rate if rate else math.inf

    @property
    def cfg(self) -> Config:
        """The run's configuration."""
        return self.run.cfg

    @cached_property
    def errors(self) -> pd.DataFrame:
        """NMSE and facts of every excitation set, by set, training, repeat, weighted and joint."""
        facts = self._of_sets(identification, FACTS)
        return self._of_sets(identification).merge(facts, on=["set", "training", "repeat"])

    @cached_property
    def histories(self) -> pd.DataFrame:
        """Metrics after every epoch, a row per variant, training and epoch."""
        return self._histories(self.run)

    @cached_property
    def subsets(self) -> pd.DataFrame:
        """Metrics after every epoch of the variants trained on other numbers of seeds, and of the run's."""
        sizes = sorted({*self.cfg.discussion.sizes, self.cfg.subset or self.cfg.seeds.count})
        return pd.concat([self._histories(on_subset(self.run, n)).assign(seeds=n) for n in sizes])

    @cached_property
    def generators(self) -> pd.DataFrame:
        """Validity, fitness, worth and likeness of the seeds, baselines and every training, a row each.

        Gains are the error of random draws from the seeds over that of each other set.
        """
        rows: list[Report] = [{"name": SEEDS, "training": 0, **self.seeds}]
        for name, baseline in baselines(self.run).items():
            rows.append({"name": name, "training": 0, **self.run.report(baseline)})
        ends = self.histories[self.histories.kept].drop(columns=["epoch", "kept"])
        for row in ends.rename(columns={"variant": "name"}).to_dict("records"):
            kept = self.run.report(library(self.run, row["name"], row["training"]))
            # The library's condition number is that of the valid trajectories, the history's that of all.
            both = {"condition": row["condition"], "condition_valid": kept.get("condition", math.nan)}
            rows.append({str(key): value for key, value in row.items()} | kept | both)
        made = self._measures
        frame = pd.DataFrame([row | self.run.report(made[row["name"], row["training"]]) for row in rows])
        errors = frame.filter(like="error").astype(float)
        return frame.join((errors.loc[0] / errors).rename(columns=lambda key: key.replace("error", "gain")))

    @cached_property
    def _measures(self) -> dict[tuple[str, int], Artifact]:
        """Artifacts of measures, by name and training of the set."""
        return {
            (pool.name, pool.training or 0): measures(self.run, pool) for pool in measured_pools(self.run)
        }

    @cached_property
    def longs(self) -> dict[str, tuple[Report, Library]]:
        """Report and library of every single long trajectory."""
        made = {f"long-{h}": long_trajectory(self.run, h) for h in self.cfg.long.harmonics}
        return {name: (self.report(artifact), self.run.load(artifact)) for name, artifact in made.items()}

    @cached_property
    def readings(self) -> dict[str, pd.DataFrame]:
        """Errors of experiment 2, as ``whole_errors``, by reading."""
        return {name: self._replicated(k) for k, name in enumerate(self.cfg.replication.readings)}

    def _replicated(self, k: int, file: str = RESULTS) -> pd.DataFrame:
        return self.run.frame(replication(self.run, self.cfg.replication.readings[k]), file)

    def dominance(self) -> float:
        """Share of the joint with the largest error in the seeds' expected unweighted mean."""
        of_seeds = self.expected[(self.expected["set"] == SEEDS) & ~self.expected.weighted.astype(bool)]
        return float(of_seeds.nmse.max() / of_seeds.nmse.sum())

    @property
    def seed_seconds(self) -> float:
        """CPU time per seed [s]; NaN for published seeds."""
        if self.cfg.seeds.method == "published":
            return float("nan")
        return float(self.seeds["cpu_seconds"]) / self.cfg.seeds.count

    def training_seconds(self, name: str, training: int) -> float:
        """CPU time of a variant's surrogates, if it has any, training and library [s]."""
        parts = [generator(self.run, name, training), library(self.run, name, training)]
        if self.cfg.gan[name].features:
            parts.append(surrogate_networks(self.run))
        return sum(float(self.costs(part)["cpu_seconds"]) for part in parts)

    @cached_property
    def as_many_seeds(self) -> dict[str, float]:
        """The histories' metrics for as many seeds as trajectories are evaluated after an epoch.

        Rank and nearest distance depend on the number of trajectories.
        """
        seeds = self.run.load(seed_set(self.run)).coefficients[: self.cfg.evaluation]
        return measure_samples(self.run.cell.constraints, self.run.cell.trajectory, seeds)

    def generated(self, name: str, training: int) -> Library:
        """A variant's library."""
        return self.run.load(library(self.run, name, training))

    def selected(self, name: str, training: int) -> Library:
        """The excitation set picked from a pool."""
        (pool,) = (pool for pool in pools(self.run) if (pool.name, pool.training or 0) == (name, training))
        return self.run.load(selection(self.run, pool))

    def report(self, artifact: Artifact) -> Report:
        """Report of an artifact, with its costs."""
        return self.run.report(artifact) | self.costs(artifact)

    def costs(self, artifact: Artifact) -> Report:
        """Costs of making an artifact; NaN for those that are not stored."""
        return defaultdict(lambda: math.nan, self.run.store.costs(artifact))

    def _of_sets(
        self,
        made: Callable[[RunContext, ExcitationSet], Artifact],
        file: str = RESULTS,
        sets: list[ExcitationSet] | None = None,
    ) -> pd.DataFrame:
        frames = [self.run.frame(made(self.run, each), file) for each in sets or excitation_sets(self.run)]
        return pd.concat(frames, ignore_index=True)

    def _expected(self, noise: str, sets: list[ExcitationSet] | None = None) -> pd.DataFrame:
        frame = self._of_sets(identification, EXPECTED, sets)
        return frame[frame.noise == noise]

    def _histories(self, run: RunContext) -> pd.DataFrame:
        parts = []
        for name, training in generators(run):
            rows = pd.DataFrame(run.history(generator(run, name, training))).astype(float)
            rows.insert(0, "epoch", np.arange(1, len(rows) + 1))
            parts.append(rows.assign(kept=rows.epoch == len(rows), variant=name, training=training))
        return pd.concat(parts, ignore_index=True)


def comparison(run: RunContext) -> dict[str, Artifacts]:
    """Artifacts of every condition that the page compares, by name."""
    current = run.cfg.condition.name
    names = run.cfg.conditions or [current]
    return {
        name: Artifacts(run if name == current else run.with_changes(f"condition={name}")) for name in names
    }
