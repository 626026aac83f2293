"""What the experiments read from the artifacts of a run, as tables."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from experiments import exp2
from sidegan.base.storage import read_json
from sidegan.gan.variants import Variant
from sidegan.library import Library
from sidegan.pipeline.plan import FACTS, HISTORY, LIBRARY, REPORT, RESULTS, SEEDS, Task, with_subset
from sidegan.pipeline.stamp import Stamp

History = list[dict[str, float | None]]


def errors(task: Task) -> pd.DataFrame:
    """NMSE and facts of every excitation set, by set, training, repeat, weighted and joint."""
    found = []
    for name, training in task.sets():
        folder = task.store.require(task.identification(name, training))
        results, facts = (pd.read_parquet(folder / file) for file in (RESULTS, FACTS))
        found.append(results.merge(facts, on=["set", "training", "repeat"]))
    return pd.concat(found, ignore_index=True).assign(seed=task.cfg.seed)


def plant(task: Task) -> pd.DataFrame:
    """NMSE of every excitation set as executed on the plant, by set, training, repeat, weighted, joint."""
    folders = [task.store.require(task.plant(*one)) for one in task.sets()]
    found = [pd.read_parquet(folder / RESULTS) for folder in folders]
    return pd.concat(found, ignore_index=True).assign(seed=task.cfg.seed)


def histories(
    task: Task, variants: dict[str, Variant] | None = None, trainings: list[int] | None = None
) -> dict[str, list[History]]:
    """Metrics after every epoch of every training of each variant; the task's own where none are given."""
    return {
        name: [
            read_json(task.store.require(task.gan(name, settings, k)) / HISTORY)
            for k in trainings or task.cfg.trainings
        ]
        for name, settings in (variants or task.cfg.gan).items()
    }


def generators(task: Task) -> pd.DataFrame:
    """Validity, fitness and diversity of the seeds and of every training of each generator, a row each."""
    rows: list[dict[str, Any]] = [
        {"name": SEEDS, "training": 0, **read_json(task.store.require(task.seeds) / REPORT)}
    ]
    for name, runs in histories(task).items():
        for training, history in zip(task.cfg.trainings, runs):
            last = history[-1]
            kept = read_json(task.store.require(task.library(name, training)) / REPORT)
            # A library holds what is valid: its condition is not that of all that the generator makes.
            known = last | kept | {"condition": last["condition"], "condition_valid": kept["condition"]}
            rows.append({"name": name, "training": training, **known})
    return pd.DataFrame(rows)


@dataclass(frozen=True)
class Evidence:
    """Everything that the reproduction report is made from, read when it is asked for."""

    task: Task

    @cached_property
    def errors(self) -> pd.DataFrame:
        """NMSE and facts of the excitation sets of experiment 1."""
        return errors(self.task)

    @cached_property
    def plant(self) -> pd.DataFrame:
        """NMSE of the excitation sets as executed on the MuJoCo plant."""
        return plant(self.task)

    @cached_property
    def histories(self) -> dict[str, list[History]]:
        """Metrics after every epoch of every training of each variant."""
        return histories(self.task)

    @cached_property
    def generators(self) -> pd.DataFrame:
        """The seeds and every training of each generator, a row each."""
        return generators(self.task)

    @cached_property
    def seeds(self) -> dict[str, Any]:
        """Report of the seed set."""
        return self.report(self.task.seeds)

    @cached_property
    def replication(self) -> exp2.Material:
        """Experiment 2."""
        return exp2.collect(self.task)

    @cached_property
    def sensitivity(self) -> pd.DataFrame:
        """Experiment 1 with other settings."""
        return pd.read_parquet(self.task.store.require(self.task.sensitivity) / RESULTS)

    @cached_property
    def density(self) -> pd.DataFrame:
        """Samples of kernel density estimates, a row for each bandwidth."""
        return pd.read_parquet(self.task.store.require(self.task.density) / RESULTS)

    @cached_property
    def subsets(self) -> dict[int, dict[str, list[History]]]:
        """Histories of the variants trained on fewer seeds, and on all of them."""
        sizes = sorted({*self.task.cfg.discussion.sizes, self.task.cfg.seeds.count})
        return {size: histories(with_subset(self.task, size)) for size in sizes}

    @cached_property
    def ablation(self) -> dict[str, list[History]]:
        """Histories of the ablation's variants, the recipe itself first."""
        cfg = self.task.cfg
        others = histories(self.task, cfg.ablation, cfg.scale.ablation_trainings)
        return {"eigen": self.histories["eigen"], **others}

    @cached_property
    def kinds(self) -> dict[str, Library]:
        """The seeds and the other kinds of seeds."""
        known = {"gradient": self.library(self.task.seeds)}
        for name in self.task.cfg.kinds:
            known[name] = self.library(self.task.kind(name).seeds)
        return known

    def union(self, name: str, key: str) -> np.ndarray:
        """A diversity of seeds and library together, one for each training."""
        return self.generators[self.generators["name"] == name][f"union_{key}"].to_numpy(float)

    def report(self, stamp: Stamp) -> dict[str, Any]:
        """Report in an artifact."""
        return read_json(self.task.store.require(stamp) / REPORT)

    def library(self, stamp: Stamp) -> Library:
        """Library in an artifact."""
        return Library.load(self.task.store.require(stamp) / LIBRARY, self.task.arm)

    def seconds(self, stamp: Stamp) -> float:
        """Wall time in which an artifact was made [s]."""
        return float(read_json(self.task.store.require(stamp) / "stamp.json")["seconds"])

    @cached_property
    def costs(self) -> pd.DataFrame:
        """Each time of the paper's text beside ours [s], a row each: key, what, ours, paper."""
        task, first = self.task, self.task.cfg.trainings[0]
        seeds, speed = self.seeds, self.report(task.timing("eigen", first))
        kind = self.report(task.kind("paper").seeds) if "paper" in task.cfg.kinds else None
        longs = [self.report(task.long(h))["cpu_seconds"] for h in task.cfg.long.harmonics]
        trainings = [
            self.seconds(task.gan(n, s, k)) for n, s in task.cfg.gan.items() for k in task.cfg.trainings
        ]
        rows = [
            ("long", "the single long trajectory, CPU", max(longs), 14 * 3600),
            ("seed", "one seed, CPU", seeds["cpu_seconds"] / seeds["count"], 360),
            ("seeds", "the seed set, wall", self.seconds(task.seeds), 30 * 3600),
            ("surrogates", "the surrogates, wall", self.seconds(task.surrogates("broad")), np.nan),
            ("training", "one training, wall", float(np.mean(trainings)), 2400),
            ("generation", "one generated trajectory", speed["generation_seconds"], 1.4e-3),
            ("checked", "one valid trajectory, checked", 1 / speed["valid_per_second"], 1 / 32),
        ]
        if kind is not None:
            once = kind["cpu_seconds"] / kind["count"]
            rows.insert(2, ("colony", "one seed by gaco + compass search, CPU", once, 360))
        return pd.DataFrame(rows, columns=["key", "what", "ours", "paper"])
