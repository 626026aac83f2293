"""Stage selection: the pools of trajectories, and the excitation sets picked from them."""

from dataclasses import dataclass
from functools import partial

from sidegan.design.selection import choose
from sidegan.library import LIBRARY, Library
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.artifact import Artifact, Build
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.baselines import long_family, long_trajectory, random_set
from sidegan.pipeline.stages.library import library
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.training import generators

RANDOM, SEEDS = "random", "seeds"


@dataclass(frozen=True)
class Pool:
    """Trajectories that a set can be picked from."""

    name: str  # ``random``, ``seeds``, or a variant
    training: int | None  # of the variant; None for others
    parts: tuple[Artifact, ...]  # artifacts with the trajectories

    @property
    def inputs(self) -> dict[str, Artifact]:
        """The parts, as inputs of an artifact."""
        return {part.maker: part for part in self.parts}

    def load(self, run: RunContext) -> Library:
        """All trajectories."""
        return run.load(*self.parts)


@dataclass(frozen=True)
class ExcitationSet:
    """Trajectories that an arm executes for its identification."""

    name: str  # of the pool, or ``long-<harmonics>``
    training: int | None  # of the variant; None for others
    family: Trajectory
    source: Artifact  # with the trajectories


def pools(run: RunContext) -> list[Pool]:
    """The pools of the paper: random trajectories, the seeds, and the seeds with each generator's library."""
    seeds = seed_set(run)
    grown = [Pool(name, k, (seeds, library(run, name, k))) for name, k in generators(run)]
    return [Pool(RANDOM, None, (random_set(run),)), Pool(SEEDS, None, (seeds,)), *grown]


def whole_sets(run: RunContext) -> list[Pool]:
    """The seeds, and each generator's library without the seeds."""
    made = [Pool(name, training, (library(run, name, training),)) for name, training in generators(run)]
    return [Pool(SEEDS, None, (seed_set(run),)), *made]


def selection(run: RunContext, pool: Pool) -> Artifact:
    """The set picked from a pool."""
    method = run.cfg.selection.method
    return run.artifact(
        "selection",
        pool.name if method == "greedy" else f"{pool.name}-{method}",
        partial(_make, pool=pool),
        run.cfg.selection,
        pool.inputs,
        training=pool.training,
    )


def excitation_sets(run: RunContext) -> list[ExcitationSet]:
    """The sets to compare: the single long trajectories, and the picks from each pool."""
    long = [
        ExcitationSet(f"long-{h}", None, long_family(run, h), long_trajectory(run, h))
        for h in run.cfg.long.harmonics
    ]
    picked = [
        ExcitationSet(pool.name, pool.training, run.cell.trajectory, selection(run, pool))
        for pool in pools(run)
    ]
    return [*long, *picked]


def _make(run: RunContext, build: Build, pool: Pool) -> None:
    cell, library = run.cell, pool.load(run)
    order = choose(run.cfg.selection, cell.body, cell.trajectory, library.coefficients, library.diagonal)
    library.take(order).save(build.folder / LIBRARY)


STAGES = {"selection": Stage(lambda run: [selection(run, pool) for pool in pools(run)])}
