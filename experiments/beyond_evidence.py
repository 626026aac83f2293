"""What the page on exact physics reads from the artifacts, as tables; parts that were not run are empty."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from experiments import artifacts
from experiments.artifacts import History
from sidegan.base.storage import read_json
from sidegan.gan.variants import Variant
from sidegan.pipeline import plan_beyond
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import (
    FACTS,
    HISTORY,
    NEGATIVES_TRAINING,
    REPORT,
    RESULTS,
    SEEDS,
    Task,
    with_subset,
)
from sidegan.pipeline.stamp import Stamp

GOOD, NEAR = 0.97, 1.1  # valid share and factor of the final condition that count as "the same quality"


@dataclass(frozen=True)
class Evidence:
    """Everything that the page is made from, read when it is asked for."""

    task: Task

    @cached_property
    def pools(self) -> pd.DataFrame:
        """Random trajectories, seeds and every training of each generator, a row each.

        Columns name, training, success (valid share without filtering), and of equally many valid ones
        condition, distance, distance_diagonal, nearest, rank; best, the smallest condition of all.
        """
        rows = []
        for name, training in plan_beyond.pools(self.task):
            told = self.report(plan_beyond.best(self.task, name, training))
            rows.append({**told, "success": self._valid_share(name, training)})
        return pd.DataFrame(rows)

    def _valid_share(self, name: str, training: int) -> float:
        if name in self.task.cfg.gan:
            last = self.histories[name][self.task.cfg.trainings.index(training)][-1]
            return float(last["success"] or 0.0)
        told = self.report(plan_beyond.pool(self.task, name, training))
        return float(told["valid_share"] if name != SEEDS else 1 - told["failed"] / told["attempts"])

    @cached_property
    def best(self) -> pd.DataFrame:
        """What the best set of every pool is worth, a row per pool, training and pick."""
        return _judged(self.task, plan_beyond.pools(self.task))

    @cached_property
    def histories(self) -> dict[str, list[History]]:
        """Metrics after every epoch of every training of each variant."""
        return artifacts.histories(self.task)

    @cached_property
    def progress(self) -> pd.DataFrame:
        """Metrics of all trainings against the seconds since nothing was there, a row per epoch."""
        rows = []
        for name, runs in self.histories.items():
            for training, history in zip(self.task.cfg.trainings, runs):
                before, spent = self.before(name), self.training_seconds(name, training)
                rows += [
                    {"variant": name, "training": training, "seconds": before + at, **row}
                    for at, row in zip(_elapsed(history, spent), history)
                ]
        return pd.DataFrame(rows)

    def before(self, name: str) -> float:
        """Wall time before a training can begin [s]: seeds, and surrogates with the GAN they learn from."""
        wanted = self.task.cfg.gan[name]
        seconds = self.seconds(self.task.seeds) if wanted.seeded else 0.0
        return seconds + (self.surrogate_seconds if wanted.surrogates else 0.0)

    @cached_property
    def surrogate_seconds(self) -> float:
        """Wall time of the surrogates [s], and of the GAN whose output they learn from."""
        ((name, settings),) = self.task.cfg.surrogates.negatives.items()
        negatives = self.task.gan(name, settings, NEGATIVES_TRAINING)
        return self.seconds(negatives) + self.seconds(self.task.surrogates("broad"))

    def training_seconds(self, name: str, training: int) -> float:
        """Time of one training [s]: CPU time where it was measured, wall time as recorded elsewhere."""
        told = self.report(plan_beyond.first_set(self.task, name, training))
        return float(told.get("training_seconds", self.wall_seconds(name, training)))

    def wall_seconds(self, name: str, training: int) -> float:
        """Wall time of one training [s] as recorded, whatever else ran beside it."""
        return self.seconds(self.task.gan(name, self.task.cfg.gan[name], training))

    @cached_property
    def first(self) -> pd.DataFrame:
        """Seconds to the first set of every way, by part: seeds, surrogates, training, drawing, total.

        Further columns: each, CPU time of one more valid trajectory; cpu, that of a training, where it was
        measured, which is then what counts; and wall, what was recorded of the training.
        """
        rows: list[dict[str, Any]] = []
        for name, training in self.task.short_sets():
            told = self.report(plan_beyond.first_set(self.task, name, training))
            row = {"name": name, "training": training, "drawing": told["seconds"]}
            row |= {"each": told.get("each", np.nan), "cpu": told.get("training_seconds", np.nan)}
            if name == SEEDS:
                row["each"] = self.seeds["cpu_seconds"] / self.seeds["count"]
            if name in self.task.cfg.gan:
                wanted = self.task.cfg.gan[name]
                row["seeds"] = self.seconds(self.task.seeds) if wanted.seeded else 0.0
                row["surrogates"] = self.surrogate_seconds if wanted.surrogates else 0.0
                row["wall"] = self.wall_seconds(name, training)
                row["training_seconds"] = self.training_seconds(name, training)
            rows.append(row)
            if name == plan_beyond.source(self.task):
                each = self.report(plan_beyond.polished(self.task, training))["each"]
                drawing = each * self.task.cfg.selection.count
                rows.append(row | {"name": plan_beyond.POLISHED, "each": each, "drawing": drawing})
        each = self.report(plan_beyond.optimised(self.task))["each"]
        alone = each * self.task.cfg.selection.count
        rows.append({"name": plan_beyond.OPTIMISED, "training": 0, "drawing": alone, "each": each})
        frame = pd.DataFrame(rows)
        parts = ["seeds", "surrogates", "training_seconds", "drawing"]
        return frame.assign(total=frame[parts].fillna(0.0).sum(axis=1))

    @cached_property
    def seeds(self) -> dict[str, Any]:
        """Report of the seed set."""
        return self.report(self.task.seeds)

    @cached_property
    def polish(self) -> pd.DataFrame | None:
        """The polish curve, a row per start and number of steps."""
        folder = self.task.store.find(plan_beyond.polish(self.task))
        return None if folder is None else pd.read_parquet(folder / RESULTS)

    @cached_property
    def objectives(self) -> pd.DataFrame | None:
        """Pool and best sets of every objective, a row per objective and pick."""
        task = plan_beyond.with_objectives(self.task)
        if not self._all(
            [plan_beyond.best(task, name, k) for name in task.cfg.gan for k in task.cfg.trainings]
        ):
            return None
        frame = _judged(task, task.short_sets())
        histories = artifacts.histories(task)
        last = pd.DataFrame([{"name": name, **runs[0][-1]} for name, runs in histories.items()])
        pools = last[["name", "success", "condition", "distance", "rank"]]
        return frame[frame.name.isin(task.cfg.gan)].merge(pools, on="name", suffixes=("", "_one"))

    @cached_property
    def few(self) -> pd.DataFrame:
        """Metrics after the last epoch against the number of seeds, a row per variant, size and training."""
        task, rows = self.task, []
        sized = [(size, plan_beyond.with_few(task, size)) for size in plan_beyond.few_sizes(task)]
        known = {name: x for name, x in task.cfg.gan.items() if x.surrogates}
        for size in task.cfg.discussion.sizes if known else []:
            smaller = with_subset(task, size)
            sized.append((size, Task(_only(smaller.cfg, known), task.store)))
        sized.append((task.cfg.seeds.count, Task(_only(task.cfg, known), task.store)))
        for size, part in sized:
            for name, settings in part.cfg.gan.items():
                for training in part.cfg.trainings:
                    folder = task.store.find(part.gan(name, settings, training))
                    if folder is not None:
                        last = read_json(folder / HISTORY)[-1]
                        rows.append({"variant": name, "seeds": size, "training": training, **last})
        return pd.DataFrame(rows)

    @cached_property
    def transfers(self) -> pd.DataFrame:
        """Metrics after every epoch for every target and way, with steps and seconds; may be empty."""
        rows = []
        for target in self.task.cfg.beyond.targets:
            for way in plan_beyond.WAYS:
                stamp = plan_beyond.transfer(self.task, target, way)
                folder = self.task.store.find(stamp)
                if folder is None:
                    continue
                history, tags = read_json(folder / HISTORY), {"target": target, "way": way}
                before = read_json(folder / REPORT)
                rows += [{**tags, "steps": 0, "seconds": 0.0, **before}] if before else []
                for k, (at, row) in enumerate(zip(_elapsed(history, self.seconds(stamp)), history), 1):
                    steps = k * self.task.cfg.beyond.epoch
                    rows.append({**tags, **row, "steps": steps, "seconds": at})
        return pd.DataFrame(rows)

    def report(self, stamp: Stamp) -> dict[str, Any]:
        """Report in an artifact."""
        return read_json(self.task.store.require(stamp) / REPORT)

    def seconds(self, stamp: Stamp) -> float:
        """Wall time in which an artifact was made [s]."""
        return float(read_json(self.task.store.require(stamp) / "stamp.json")["seconds"])

    def _all(self, stamps: list[Stamp]) -> bool:
        return all(self.task.store.find(stamp) is not None for stamp in stamps)


def arrival(curve: pd.DataFrame, final: float) -> tuple[float, float]:
    """Steps and seconds after which a training first has the quality; NaN when it never has.

    Args:
        curve: rows of one training.
        final: median condition number at the end of the training from scratch.
    """
    good = curve[(curve.success >= GOOD) & (curve.condition <= NEAR * final)]
    return (np.nan, np.nan) if good.empty else (float(good.steps.min()), float(good.seconds.min()))


def _judged(task: Task, pools: list[tuple[str, int]]) -> pd.DataFrame:
    """Facts and mean nMSE of the best sets of some pools of a task."""
    frames = []
    for name, training in pools:
        folder = task.store.require(plan_beyond.best(task, name, training))
        results = pd.read_parquet(folder / RESULTS)
        errors = results.groupby(["pick", "weighted"]).nmse.mean().unstack("weighted")
        errors = errors.rename(columns={False: "nmse", True: "nmse_weighted"}).reset_index()
        frames.append(pd.read_parquet(folder / FACTS).merge(errors, on="pick"))
    return pd.concat(frames, ignore_index=True)


def _elapsed(history: History, spent: float) -> list[float]:
    """Seconds since the start of a training after every epoch; evenly over ``spent`` where not recorded."""
    each = [row.get("seconds") for row in history]
    if None in each:
        return [spent * (k + 1) / len(history) for k in range(len(history))]
    return list(np.cumsum(np.array(each, float)))


def _only(cfg: Config, known: dict[str, Variant]) -> Config:
    return replace(cfg, gan=known or cfg.gan, stages=[])
