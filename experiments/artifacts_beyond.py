"""What the page on exact physics shows, read from the artifacts of a run as frames; beside ``artifacts``."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pandas as pd

from experiments.artifacts import Artifacts
from sidegan.pipeline import plan_beyond
from sidegan.pipeline.plan import FACTS, NEGATIVES_TRAINING, RESULTS, SEEDS, Task, variant, with_subset

POLISHED, OPTIMISED = plan_beyond.POLISHED, plan_beyond.OPTIMISED  # pools beside the variants'
GREEDY, OPTIMAL = plan_beyond.GREEDY, plan_beyond.OPTIMAL  # ways to pick a set
SCRATCH, TRANSFER = plan_beyond.SCRATCH, plan_beyond.TRANSFER  # ways to train for a target


@dataclass(frozen=True)
class BeyondArtifacts(Artifacts):
    """What was made for the page on exact physics; frames of parts that were not run are empty."""

    @cached_property
    def source(self) -> str:
        """The variant that is polished and transferred.

        Raises:
            ConfigError: when it is not trained.
        """
        return plan_beyond.source(self.task)

    @property
    def pool_names(self) -> list[str]:
        """Names of the pools that are compared."""
        return list(dict.fromkeys(name for name, _ in plan_beyond.pools(self.task)))

    @cached_property
    def pools(self) -> pd.DataFrame:
        """Random trajectories, seeds and every training of each generator, a row each.

        Columns name, training, success (valid share without filtering), and of equally many valid ones
        condition, distance, distance_diagonal, nearest, rank; best, the smallest condition number of all.
        """
        rows = []
        for name, training in plan_beyond.pools(self.task):
            report = self._report(plan_beyond.best(self.task, name, training))
            rows.append({**report, "success": self._valid_share(name, training)})
        return pd.DataFrame(rows)

    def _valid_share(self, name: str, training: int) -> float:
        if name in self.cfg.gan:
            history = self.histories[(self.histories.variant == name) & (self.histories.training == training)]
            return float(np.nan_to_num(history.success.iloc[-1]))
        report = self._report(plan_beyond.pool(self.task, name, training))
        return float(report["valid_share"] if name != SEEDS else 1 - report["failed"] / report["attempts"])

    @cached_property
    def best(self) -> pd.DataFrame:
        """Facts and mean nMSE of the best sets of every pool, a row per pool, training and pick."""
        return self._judged(self.task, plan_beyond.pools(self.task))

    def needs(self, name: str) -> tuple[bool, bool]:
        """Whether a variant needs seeds, and surrogates."""
        settings = variant(name, self.cfg.gan[name])
        return settings.seeded, settings.surrogates

    @cached_property
    def surrogates_seconds(self) -> float:
        """Wall time of the surrogates [s], and of the GAN whose output they learn from."""
        ((name, settings),) = self.cfg.surrogates.negatives.items()
        negatives = self.task.gan(name, settings, NEGATIVES_TRAINING)
        return self._seconds(negatives) + self._seconds(self.task.surrogates("broad"))

    @cached_property
    def first_sets(self) -> pd.DataFrame:
        """Times of the first set of every way [s]: seconds, and where measured each and training_seconds."""
        rows = [
            {"name": name, "training": k, **self._report(plan_beyond.first_set(self.task, name, k))}
            for name, k in self.task.short_sets()
        ]
        return pd.DataFrame(rows).reindex(columns=["name", "training", "seconds", "each", "training_seconds"])

    def polished_each(self, training: int) -> float:
        """Time of polishing one trajectory [s]."""
        return float(self._report(plan_beyond.polished(self.task, training))["each"])

    @cached_property
    def optimised_each(self) -> float:
        """Time of optimising one trajectory with little reserve [s]."""
        return float(self._report(plan_beyond.optimised(self.task))["each"])

    @cached_property
    def polish(self) -> pd.DataFrame:
        """The polish curve, a row per start and number of steps."""
        stamp = plan_beyond.polish(self.task)
        return self._frame(stamp, RESULTS) if self._exists(stamp) else pd.DataFrame()

    @cached_property
    def objectives(self) -> pd.DataFrame:
        """Best sets of every objective and its pool (suffix ``_one``), a row per objective and pick."""
        task = plan_beyond.with_objectives(self.task)
        pairs = [(name, k) for name in task.cfg.gan for k in task.cfg.trainings]
        if not all(self._exists(plan_beyond.best(task, *one)) for one in pairs):
            return pd.DataFrame()
        best = self._judged(task, task.short_sets())
        last = (
            self._histories(task, task.cfg.gan).groupby("variant").tail(1).rename(columns={"variant": "name"})
        )
        pools = last[["name", "success", "condition", "distance", "rank"]]
        return best[best.name.isin(task.cfg.gan)].merge(pools, on="name", suffixes=("", "_one"))

    @cached_property
    def few(self) -> pd.DataFrame:
        """Metrics after the last epoch, a row per variant, number of seeds and training that there is."""
        task, rows = self.task, []
        parts = [(size, plan_beyond.with_few(task, size)) for size in plan_beyond.few_sizes(task)]
        taught = {name: x for name, x in task.cfg.gan.items() if variant(name, x).surrogates}
        smaller = [(size, with_subset(task, size)) for size in task.cfg.discussion.sizes if taught]
        for size, part in [*smaller, (task.cfg.seeds.count, task)]:
            cfg = replace(part.cfg, gan=taught or part.cfg.gan, stages=[])
            parts.append((size, Task(cfg, task.store)))
        for size, part in parts:
            for name, settings in part.cfg.gan.items():
                stamps = {k: part.gan(name, settings, k) for k in part.cfg.trainings}
                trained = {k: self._history(stamp) for k, stamp in stamps.items() if self._exists(stamp)}
                rows += [h.tail(1).assign(variant=name, seeds=size, training=k) for k, h in trained.items()]
        return pd.concat(rows, ignore_index=True) if rows else pd.DataFrame()

    @cached_property
    def transfers(self) -> pd.DataFrame:
        """Metrics for every target and way after every epoch, with the steps and seconds until then."""
        parts = []
        for target in self.cfg.beyond.targets:
            for way in plan_beyond.WAYS:
                stamp = plan_beyond.transfer(self.task, target, way)
                if not self._exists(stamp):
                    continue
                history = self._history(stamp)
                steps, at = history.epoch * self.cfg.beyond.epoch, elapsed(history, self._seconds(stamp))
                before = self._report(stamp)
                begun = pd.DataFrame([{"steps": 0, "seconds": 0.0, **before}] if before else [])
                curve = pd.concat([begun, history.assign(steps=steps, seconds=at)], ignore_index=True)
                parts.append(curve.assign(target=target, way=way))
        return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()

    def _judged(self, task: Task, pools: list[tuple[str, int]]) -> pd.DataFrame:
        frames = []
        for one in pools:
            stamp = plan_beyond.best(task, *one)
            errors = self._frame(stamp, RESULTS).groupby(["pick", "weighted"]).nmse.mean().unstack("weighted")
            errors = errors.rename(columns={False: "nmse", True: "nmse_weighted"}).reset_index()
            frames.append(self._frame(stamp, FACTS).merge(errors, on="pick"))
        return pd.concat(frames, ignore_index=True)


def elapsed(history: pd.DataFrame, spent: float) -> np.ndarray:
    """Seconds since the start of a training after every epoch; evenly over ``spent`` where not recorded."""
    each = history.get("seconds")
    if each is None or each.isna().any():
        return spent * np.arange(1, len(history) + 1) / len(history)
    return each.cumsum().to_numpy()
