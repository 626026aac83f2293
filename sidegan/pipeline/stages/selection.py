"""Stage selection: the excitation sets, picked from the seeds, and from the seeds with each library."""

from functools import partial
from pathlib import Path

import pandas as pd
from torch import Tensor

from sidegan.design.selection import choose
from sidegan.library import Library
from sidegan.pipeline.graph import Artifact, Build, Metrics
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.pools import ExcitationSet, Pool, long_sets, pools
from sidegan.pipeline.task import LIBRARY, Task


def selection(task: Task, pool: Pool) -> Artifact:
    """The set picked from a pool."""
    method = task.cfg.selection.method
    return task.artifact(
        "selection",
        pool.name if method == "greedy" else f"{pool.name}-{method}",
        partial(_make, pool=pool),
        task.cfg.selection,
        pool.inputs,
        training=pool.training,
        title=f"selection/{pool.title}",
        metrics=partial(_generated, task.cfg.seeds.method),
    )


def excitation_sets(task: Task) -> list[ExcitationSet]:
    """Every set that is compared: the single long trajectories, and what was picked from each pool."""
    picked = [
        ExcitationSet(one.name, one.training, one.title, task.trajectory, selection(task, one))
        for one in pools(task)
    ]
    return [*long_sets(task), *picked]


def pick(task: Task, library: Library) -> Tensor:
    """Indices of the configured pick from a library, in the order of choice, (count,)."""
    return choose(task.cfg.selection, task.body, task.trajectory, library.coefficients, library.diagonal)


def _make(task: Task, build: Build, pool: Pool) -> None:
    library = pool.load(task)
    library.take(pick(task, library)).save(build.folder / LIBRARY)


def _generated(seeds: str, folder: Path) -> Metrics:
    """Number of a set's trajectories that are not seeds."""
    source = pd.read_parquet(folder / LIBRARY, columns=["source"]).source
    return {"generated": int((source != seeds).sum())}


STAGE = Stage(lambda task: [selection(task, pool) for pool in pools(task)])
