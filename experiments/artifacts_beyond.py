"""What the page on exact physics shows, read from the artifacts of a run as frames; beside ``artifacts``."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from experiments.artifacts import Artifacts
from sidegan.pipeline.stages.best import GREEDY, OPTIMAL, all_pools, best_sets
from sidegan.pipeline.stages.few_seeds import few_sizes, on_few
from sidegan.pipeline.stages.first_set import first_set, ways
from sidegan.pipeline.stages.narrow import NARROW, narrow
from sidegan.pipeline.stages.objectives import with_objectives
from sidegan.pipeline.stages.optimised import OPTIMISED, optimised
from sidegan.pipeline.stages.polish import POLISHED, polish_curve, polished, source
from sidegan.pipeline.stages.pools import SEEDS, Pool, own_pools
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.subsets import on_subset
from sidegan.pipeline.stages.training import generator, generators, negatives, surrogates
from sidegan.pipeline.stages.transfer import SCRATCH, TRANSFER, transfers
from sidegan.pipeline.task import FACTS, Task

__all__ = ["GREEDY", "NARROW", "OPTIMAL", "OPTIMISED", "POLISHED", "SCRATCH", "TRANSFER", "BeyondArtifacts"]

_PARTS = ["seeds", "surrogates", "training_seconds", "drawing"]  # of the time to a first set


@dataclass(frozen=True)
class BeyondArtifacts(Artifacts):
    """What was made for the page on exact physics; frames of parts that were not run are empty."""

    def __post_init__(self) -> None:
        source(self.task)  # raises ConfigError when the variant that all is compared with is not trained

    @property
    def source(self) -> str:
        """The variant that is polished and transferred."""
        return self.cfg.beyond.source

    @cached_property
    def pools(self) -> pd.DataFrame:
        """Random trajectories, seeds and every training of each generator, a row each.

        Columns name, training, success (valid share without filtering), and of equally many valid ones
        condition, distance, distance_diagonal, nearest, rank; best, the smallest condition number of all.
        """
        pools = all_pools(self.task)
        rows = [self.task.report(best_sets(self.task, p)) | {"success": self._valid_share(p)} for p in pools]
        return pd.DataFrame(rows)

    def _valid_share(self, pool: Pool) -> float:
        if pool.name in self.cfg.gan:
            history = self.histories[self.histories.variant == pool.name]
            return float(np.nan_to_num(history[history.training == pool.training].success.iloc[-1]))
        report = self.task.report(pool.parts[0])
        share = report["valid_share"] if pool.name != SEEDS else 1 - report["failed"] / report["attempts"]
        return float(share)

    @cached_property
    def best(self) -> pd.DataFrame:
        """Facts and mean nMSE of the best sets of every pool, a row per pool, training and pick."""
        return self._judged(all_pools(self.task))

    @cached_property
    def first_times(self) -> pd.DataFrame:
        """Seconds to the first set of every way: seeds, surrogates, training_seconds, drawing, and total.

        Further columns: each, CPU time of one more valid trajectory; cpu, that of a training, where it was
        measured, which is then what counts; and wall, what was recorded of the training. Times that were not
        kept are not a number.
        """
        count, rows = self.cfg.selection.count, []
        for name, k in ways(self.task):
            self.task.store.require(first_set(self.task, name, k))
            costs = self.costs(first_set(self.task, name, k))
            row = {"name": name, "training": k or 0, "drawing": costs["cpu_seconds"], "each": costs["each"]}
            if name == SEEDS:
                row["each"] = self.seeds["cpu_seconds"] / self.seeds["count"]
            if name in self.cfg.gan:
                row |= self._training_times(name, k or 0, costs["training_seconds"])
            rows.append(row)
            if name == self.source:
                each = self.costs(polished(self.task, k or 0))["each"]
                rows.append(row | {"name": POLISHED, "each": each, "drawing": each * count})
        each = self.costs(optimised(self.task))["each"]
        rows.append({"name": OPTIMISED, "training": 0, "drawing": each * count, "each": each})
        each, seeds = self.costs(narrow(self.task))["each"], self.seconds(seed_set(self.task))
        rows.append({"name": NARROW, "training": 0, "seeds": seeds, "drawing": each * count, "each": each})
        frame = pd.DataFrame(rows).reindex(columns=["name", "training", "each", "cpu", "wall", *_PARTS])
        needed = ~frame.name.isin([*self.cfg.gan, POLISHED])
        frame.loc[needed, _PARTS[:-1]] = frame.loc[needed, _PARTS[:-1]].fillna(0.0)
        return frame.assign(total=frame[_PARTS].sum(axis=1, skipna=False))

    def _training_times(self, name: str, training: int, cpu: float) -> dict[str, float]:
        """Times before and of a training [s]: CPU time where it was measured, wall time elsewhere."""
        task, variant = self.task, self.cfg.gan[name]
        taught = (negatives(task), surrogates(task, "broad"))  # with the GAN whose output they learn from
        wall = self.seconds(generator(task, name, training))
        return {
            "cpu": cpu,
            "seeds": self.seconds(seed_set(task)) if variant.seeded else 0.0,
            "surrogates": sum(map(self.seconds, taught)) if variant.learned else 0.0,
            "wall": wall,
            "training_seconds": wall if np.isnan(cpu) else cpu,
        }

    @cached_property
    def progress(self) -> pd.DataFrame:
        """Metrics of all trainings after every epoch, against the seconds since nothing was there."""
        parts = []
        for row in self.first_times.to_dict("records"):
            of_variant = self.histories[self.histories.variant == row["name"]]
            history = of_variant[of_variant.training == row["training"]]
            if len(history):
                each = self.costs(generator(self.task, row["name"], row["training"])).get("epochs")
                spent = elapsed(len(history), row["training_seconds"], each)
                parts.append(history.assign(seconds=row["seeds"] + row["surrogates"] + spent))
        return pd.concat(parts, ignore_index=True)

    @cached_property
    def polish(self) -> pd.DataFrame:
        """The polish curve, a row per start and number of steps; seconds are those of each valid one."""
        curve = polish_curve(self.task)
        if not self._exists(curve):
            return pd.DataFrame()
        frame = self.task.frame(curve)
        return frame.assign(seconds=np.array(self.costs(curve)["each"]) / frame.success.replace(0.0, np.nan))

    @cached_property
    def objectives(self) -> pd.DataFrame:
        """Best sets of every objective and its pool (suffix ``_one``), a row per objective and pick."""
        task = with_objectives(self.task)
        pools = own_pools(task)
        if not all(self._exists(best_sets(task, pool)) for pool in pools):
            return pd.DataFrame()
        best, histories = self._judged(pools, task), self._histories(task)
        ends = histories[histories.kept].rename(columns={"variant": "name"})
        ends = ends[["name", "success", "condition", "distance", "rank"]]
        return best[best.name.isin(task.cfg.gan)].merge(ends, on="name", suffixes=("", "_one"))

    @cached_property
    def few(self) -> pd.DataFrame:
        """Metrics of the kept epoch, a row per variant, number of seeds and training that there is."""
        task, rows = self.task, []
        parts = [(size, on_few(task, size)) for size in few_sizes(task)]
        taught = {name: one for name, one in task.cfg.gan.items() if one.learned}
        sizes = self.cfg.discussion.sizes if taught else []
        smaller = [(size, on_subset(task, size)) for size in sizes]
        for size, part in [*smaller, (task.cfg.seeds.count, task)]:
            parts.append((size, part.with_settings(gan=taught or part.cfg.gan)))
        for size, part in parts:
            for name, k in generators(part):
                if self._exists(generator(part, name, k)):
                    history = self._history(generator(part, name, k))
                    rows.append(history[history.kept].assign(variant=name, seeds=size, training=k))
        return _stacked(rows)

    @cached_property
    def transfers(self) -> pd.DataFrame:
        """Metrics for every target and way after every epoch, with the steps and seconds until then."""
        parts = []
        for (target, way), artifact in transfers(self.task).items():
            if not self._exists(artifact):
                continue
            history, costs = self._history(artifact), self.costs(artifact)
            at = elapsed(len(history), costs["seconds"], costs.get("epochs"))
            before = {key: x for key, x in self.task.report(artifact).items() if key != "kept_epoch"}
            begun = pd.DataFrame([{"steps": 0, "seconds": 0.0, **before}] if before else [])
            steps = history.epoch * self.cfg.beyond.epoch
            curve = pd.concat([begun, history.assign(steps=steps, seconds=at)], ignore_index=True)
            parts.append(curve.assign(target=target, way=way))
        return _stacked(parts)

    def _judged(self, pools: Iterable[Pool], task: Task | None = None) -> pd.DataFrame:
        frames = []
        for artifact in (best_sets(task or self.task, pool) for pool in pools):
            errors = self.task.frame(artifact).groupby(["pick", "weighted"]).nmse.mean().unstack("weighted")
            errors = errors.rename(columns={False: "nmse", True: "nmse_weighted"}).reset_index()
            frames.append(self.task.frame(artifact, FACTS).merge(errors, on="pick"))
        return pd.concat(frames, ignore_index=True)

    def _exists(self, artifact: Any) -> bool:
        return self.task.store.find(artifact) is not None


def elapsed(epochs: int, spent: float, each: list[float] | None = None) -> np.ndarray:
    """Seconds since the start of a training after every epoch; evenly over ``spent`` where not measured."""
    return spent * np.arange(1, epochs + 1) / epochs if each is None else np.cumsum(each)


def _stacked(frames: list[pd.DataFrame]) -> pd.DataFrame:
    return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame()
