"""What the page on exact physics shows, read from the artifacts of a run as frames; beside ``artifacts``."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from experiments.artifacts import Artifacts
from sidegan.pipeline.stages.best import GREEDY, OPTIMAL, all_pools, best_sets
from sidegan.pipeline.stages.few_seeds import few_sizes, on_few
from sidegan.pipeline.stages.first_set import first_set, ways
from sidegan.pipeline.stages.objectives import with_objectives
from sidegan.pipeline.stages.optimised import OPTIMISED, optimised
from sidegan.pipeline.stages.polish import POLISHED, polish_curve, polished, source
from sidegan.pipeline.stages.pools import SEEDS, Pool, own_pools
from sidegan.pipeline.stages.subsets import on_subset
from sidegan.pipeline.stages.training import generator, generators, negatives, surrogates
from sidegan.pipeline.stages.transfer import SCRATCH, TRANSFER, transfers
from sidegan.pipeline.task import FACTS, Task

__all__ = [
    "GREEDY",
    "OPTIMAL",
    "OPTIMISED",
    "POLISHED",
    "SCRATCH",
    "TRANSFER",
    "BeyondArtifacts",
]


@dataclass(frozen=True)
class BeyondArtifacts(Artifacts):
    """What was made for the page on exact physics; frames of parts that were not run are empty."""

    @cached_property
    def source(self) -> str:
        """The variant that is polished and transferred.

        Raises:
            ConfigError: when it is not trained.
        """
        _ = source(self.task)
        return self.cfg.beyond.source

    @property
    def pool_names(self) -> list[str]:
        """Names of the pools that are compared."""
        return list(dict.fromkeys(pool.name for pool in all_pools(self.task)))

    @cached_property
    def pools(self) -> pd.DataFrame:
        """Random trajectories, seeds and every training of each generator, a row each.

        Columns name, training, success (valid share without filtering), and of equally many valid ones
        condition, distance, distance_diagonal, nearest, rank; best, the smallest condition number of all.
        """
        rows = []
        for pool in all_pools(self.task):
            report = self.task.report(best_sets(self.task, pool))
            rows.append({**report, "success": self._valid_share(pool)})
        return pd.DataFrame(rows)

    def _valid_share(self, pool: Pool) -> float:
        if pool.name in self.cfg.gan:
            history = self.histories[self.histories.variant == pool.name]
            return float(np.nan_to_num(history[history.training == pool.training].success.iloc[-1]))
        report = self.task.report(pool.parts[0])
        return float(
            report["valid_share"] if pool.name != SEEDS else 1 - report["failed"] / report["attempts"]
        )

    @cached_property
    def best(self) -> pd.DataFrame:
        """Facts and mean nMSE of the best sets of every pool, a row per pool, training and pick."""
        return self._judged(self.task, all_pools(self.task))

    def needs(self, name: str) -> tuple[bool, bool]:
        """Whether a variant needs seeds, and surrogates."""
        variant = self.cfg.gan[name]
        return variant.seeded, variant.surrogates

    @cached_property
    def surrogates_seconds(self) -> float:
        """Wall time of the surrogates [s], and of the GAN whose output they learn from."""
        return self.seconds(negatives(self.task)) + self.seconds(surrogates(self.task, "broad"))

    @cached_property
    def first_sets(self) -> pd.DataFrame:
        """Times of the first set of every way [s]: seconds, and where measured each and training_seconds."""
        rows = []
        for name, k in ways(self.task):
            self.task.store.require(first_set(self.task, name, k))
            costs = self.costs(first_set(self.task, name, k))
            rows.append({"name": name, "training": k or 0, **costs, "seconds": costs["cpu_seconds"]})
        return pd.DataFrame(rows).reindex(columns=["name", "training", "seconds", "each", "training_seconds"])

    def polished_each(self, training: int) -> float:
        """Time of polishing one trajectory [s]."""
        return float(self.costs(polished(self.task, training))["each"])

    @cached_property
    def optimised_each(self) -> float:
        """Time of optimising one trajectory with little reserve [s]."""
        return float(self.costs(optimised(self.task))["each"])

    @cached_property
    def polish(self) -> pd.DataFrame:
        """The polish curve, a row per start and number of steps."""
        curve = polish_curve(self.task)
        if not self._exists(curve):
            return pd.DataFrame()
        return self.task.frame(curve).assign(seconds=self.costs(curve)["each"])

    @cached_property
    def objectives(self) -> pd.DataFrame:
        """Best sets of every objective and its pool (suffix ``_one``), a row per objective and pick."""
        task = with_objectives(self.task)
        pools = own_pools(task)
        if not all(self._exists(best_sets(task, pool)) for pool in pools):
            return pd.DataFrame()
        best = self._judged(task, pools)
        last = (
            self._histories(task, task.cfg.gan).groupby("variant").tail(1).rename(columns={"variant": "name"})
        )
        ends = last[["name", "success", "condition", "distance", "rank"]]
        return best[best.name.isin(task.cfg.gan)].merge(ends, on="name", suffixes=("", "_one"))

    @cached_property
    def few(self) -> pd.DataFrame:
        """Metrics after the last epoch, a row per variant, number of seeds and training that there is."""
        task, rows = self.task, []
        parts = [(size, on_few(task, size)) for size in few_sizes(task)]
        taught = {name: one for name, one in task.cfg.gan.items() if one.surrogates}
        sizes = self.cfg.discussion.sizes if taught else []
        smaller = [(size, on_subset(task, size)) for size in sizes]
        for size, part in [*smaller, (task.cfg.seeds.count, task)]:
            parts.append((size, part.with_settings(gan=taught or part.cfg.gan)))
        for size, part in parts:
            for name, k in generators(part):
                if self._exists(generator(part, name, k)):
                    last = self._history(generator(part, name, k)).tail(1)
                    rows.append(last.assign(variant=name, seeds=size, training=k))
        return pd.concat(rows, ignore_index=True) if rows else pd.DataFrame()

    @cached_property
    def transfers(self) -> pd.DataFrame:
        """Metrics for every target and way after every epoch, with the steps and seconds until then."""
        parts = []
        for (target, way), artifact in transfers(self.task).items():
            if not self._exists(artifact):
                continue
            history, costs = self._history(artifact), self.costs(artifact)
            at = elapsed(len(history), costs["seconds"], costs.get("epochs"))
            before = self.task.report(artifact)
            begun = pd.DataFrame([{"steps": 0, "seconds": 0.0, **before}] if before else [])
            steps = history.epoch * self.cfg.beyond.epoch
            curve = pd.concat([begun, history.assign(steps=steps, seconds=at)], ignore_index=True)
            parts.append(curve.assign(target=target, way=way))
        return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()

    def _judged(self, task: Task, pools: list[Pool]) -> pd.DataFrame:
        frames = []
        for pool in pools:
            artifact = best_sets(task, pool)
            errors = self.task.frame(artifact).groupby(["pick", "weighted"]).nmse.mean().unstack("weighted")
            errors = errors.rename(columns={False: "nmse", True: "nmse_weighted"}).reset_index()
            frames.append(self.task.frame(artifact, FACTS).merge(errors, on="pick"))
        return pd.concat(frames, ignore_index=True)


def elapsed(epochs: int, spent: float, each: list[float] | None = None) -> np.ndarray:
    """Seconds since the start of a training after every epoch; evenly over ``spent`` where not measured."""
    return spent * np.arange(1, epochs + 1) / epochs if each is None else np.cumsum(each)
