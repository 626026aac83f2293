"""What the experiments show, read from a run's artifacts as frames; nothing else here opens an artifact."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from sidegan.base.storage import read_json
from sidegan.library import Library
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.config import Config, GanVariant
from sidegan.pipeline.plan import (
    FACTS,
    HISTORY,
    LIBRARY,
    RANDOM,
    REPORT,
    RESULTS,
    SEEDS,
    Task,
    with_subset,
)
from sidegan.pipeline.plan_conditional import STUDY, Conditions
from sidegan.pipeline.stamp import Stamp
from sidegan.robot import Arm

__all__ = ["LIBRARY", "RANDOM", "SEEDS", "STUDY", "Artifacts", "Conditional", "Report", "conditional"]

Report = dict[str, Any]


@dataclass(frozen=True)
class Artifacts:
    """What was made for one task, read when it is first needed.

    Raises:
        ArtifactError: by every member, when what it reads was not made.
    """

    task: Task

    @property
    def cfg(self) -> Config:
        """The run's configuration."""
        return self.task.cfg

    @property
    def arm(self) -> Arm:
        """The configured arm."""
        return self.task.arm

    @property
    def family(self) -> Trajectory:
        """The family of the short trajectories."""
        return self.task.trajectory

    @property
    def parameters_count(self) -> int:
        """Number of base parameters."""
        return self.task.body.parameters_count

    def long_family(self, harmonics: int) -> Trajectory:
        """The family of a single long trajectory."""
        return self.task.long_trajectory(harmonics)

    @cached_property
    def errors(self) -> pd.DataFrame:
        """NMSE and facts of every excitation set, by seed, set, training, repeat, weighted and joint."""
        parts = []
        for one in self.task.sets():
            stamp = self.task.identification(*one)
            facts = self._frame(stamp, FACTS)
            parts.append(self._frame(stamp, RESULTS).merge(facts, on=["set", "training", "repeat"]))
        return pd.concat(parts, ignore_index=True).assign(seed=self.cfg.seed)

    @cached_property
    def plant(self) -> pd.DataFrame:
        """NMSE of every excitation set as executed on the plant, by seed, set, training, repeat, …."""
        parts = [self._frame(self.task.plant(*one), RESULTS) for one in self.task.sets()]
        return pd.concat(parts, ignore_index=True).assign(seed=self.cfg.seed)

    @cached_property
    def histories(self) -> pd.DataFrame:
        """Metrics of each variant after every epoch of every training, a row per variant, training, epoch."""
        return self._histories(self.task, self.cfg.gan)

    @cached_property
    def subsets(self) -> pd.DataFrame:
        """Metrics after every epoch of the variants trained on fewer seeds, and on all of them."""
        sizes = sorted({*self.cfg.discussion.sizes, self.cfg.seeds.count})
        parts = ((size, with_subset(self.task, size)) for size in sizes)
        return pd.concat([self._histories(part, part.cfg.gan).assign(seeds=n) for n, part in parts])

    @cached_property
    def ablation(self) -> pd.DataFrame:
        """Metrics after every epoch of the ablation's variants, the recipe itself first."""
        others = self._histories(self.task, self.cfg.ablation, self.cfg.scale.ablation_trainings)
        return pd.concat([self.histories[self.histories.variant == "eigen"], others], ignore_index=True)

    @cached_property
    def generators(self) -> pd.DataFrame:
        """Validity, fitness and diversity of the seeds and of each generator's every training, a row each."""
        rows: list[Report] = [{"name": SEEDS, "training": 0, **self.seeds}]
        last = self.histories.groupby(["variant", "training"], sort=False).tail(1).drop(columns="epoch")
        for row in last.rename(columns={"variant": "name"}).to_dict("records"):
            kept = self._report(self.task.library(row["name"], row["training"]))
            # A library holds what is valid: its condition number is not that of all that the generator makes.
            both = {"condition": row["condition"], "condition_valid": kept["condition"]}
            rows.append({str(key): value for key, value in row.items()} | kept | both)
        return pd.DataFrame(rows)

    @cached_property
    def seeds(self) -> Report:
        """Report of the seed set."""
        return self._report(self.task.seeds)

    @cached_property
    def whole_errors(self) -> pd.DataFrame:
        """NMSE of experiment 2 by set, training, repeat, weighted and joint."""
        return self._frame(self.task.replication, RESULTS)

    @cached_property
    def whole_facts(self) -> pd.DataFrame:
        """Covariance norm and samples of experiment 2 by set, training and repeat."""
        return self._frame(self.task.replication, FACTS)

    @cached_property
    def sensitivity(self) -> pd.DataFrame:
        """Experiment 1 with other settings."""
        return self._frame(self.task.sensitivity, RESULTS)

    @cached_property
    def density(self) -> pd.DataFrame:
        """Samples of kernel density estimates, a row for each bandwidth."""
        return self._frame(self.task.density, RESULTS)

    @cached_property
    def longs(self) -> dict[int, tuple[Report, Library]]:
        """Report and library of every single long trajectory, by its harmonics."""
        return {h: self._made(self.task.long(h)) for h in self.cfg.long.harmonics}

    @cached_property
    def kinds(self) -> dict[str, tuple[Report, Library]]:
        """Report and library of the seeds and of the other kinds of seeds."""
        stamps = {"gradient": self.task.seeds} | {n: self.task.kind(n).seeds for n in self.cfg.kinds}
        return {name: self._made(stamp) for name, stamp in stamps.items()}

    def generated(self, name: str, training: int) -> Library:
        """A variant's own library."""
        return self._library(self.task.library(name, training))

    def selected(self, name: str, training: int) -> Library:
        """The excitation set that was picked from one pool."""
        return self._library(self.task.selection(name, training))

    @cached_property
    def speed(self) -> Report:
        """Measured speed of the first training of the eigen variant, and the machine."""
        return self._report(self.task.timing("eigen", self.cfg.trainings[0]))

    @cached_property
    def seeds_seconds(self) -> float:
        """Wall time of the seed set [s]."""
        return self._seconds(self.task.seeds)

    @cached_property
    def surrogates_seconds(self) -> float:
        """Wall time of the surrogates [s]."""
        return self._seconds(self.task.surrogates("broad"))

    def training_wall(self, name: str, training: int) -> float:
        """Wall time of one training [s], whatever else ran beside it."""
        return self._seconds(self.task.gan(name, self.cfg.gan[name], training))

    def _histories(
        self, task: Task, variants: dict[str, GanVariant], trainings: Iterable[int] | None = None
    ) -> pd.DataFrame:
        parts = [
            self._history(task.gan(name, settings, training)).assign(variant=name, training=training)
            for name, settings in variants.items()
            for training in trainings or task.cfg.trainings
        ]
        return pd.concat(parts, ignore_index=True)

    def _history(self, stamp: Stamp) -> pd.DataFrame:
        rows = pd.DataFrame(read_json(self._folder(stamp) / HISTORY)).astype(float)
        rows.insert(0, "epoch", np.arange(1, len(rows) + 1))
        return rows

    def _made(self, stamp: Stamp) -> tuple[Report, Library]:
        return self._report(stamp), self._library(stamp)

    def _report(self, stamp: Stamp) -> Report:
        return read_json(self._folder(stamp) / REPORT)

    def _library(self, stamp: Stamp) -> Library:
        return Library.load(self._folder(stamp) / LIBRARY, self.arm)

    def _frame(self, stamp: Stamp, file: str) -> pd.DataFrame:
        return pd.read_parquet(self._folder(stamp) / file)

    def _seconds(self, stamp: Stamp) -> float:
        return float(read_json(self._folder(stamp) / "stamp.json")["seconds"])

    def _folder(self, stamp: Stamp) -> Path:
        return self.task.store.require(stamp)

    def _exists(self, stamp: Stamp) -> bool:
        return self.task.store.find(stamp) is not None


class Conditional(NamedTuple):
    """What was made for conditioned generation.

    Attributes:
        study: a row per kind of condition, and one per choice of links; None where a library was requested.
        report: of that library.
        library: its file.
    """

    study: dict[str, list[Report]] | None
    report: Report
    library: Path | None


def conditional(task: Task) -> Conditional:
    """The study of conditioned generation, or one library."""
    conditions = Conditions(task)
    if conditions.asked is None:
        return Conditional(read_json(task.store.require(conditions.study) / STUDY), {}, None)
    folder = task.store.require(conditions.library)
    return Conditional(None, read_json(folder / REPORT), folder / LIBRARY)
