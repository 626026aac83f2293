"""Stage selection: the pools of trajectories, and the excitation sets picked from them."""

from dataclasses import dataclass
from functools import partial

from torch import Tensor

from sidegan.design.selection import choose
from sidegan.library import Library
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.artifact import Artifact, Build
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.baselines import long_family, long_trajectory, random_set
from sidegan.pipeline.stages.library import library
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.training import generators
from sidegan.pipeline.task import LIBRARY, Task

RANDOM, SEEDS = "random", "seeds"


@dataclass(frozen=True)
class Pool:
    """Trajectories that a set can be picked from."""

    name: str  # of whoever made them: ``random``, ``seeds``, or a variant
    training: int | None  # of the variant; None where nothing was trained
    parts: tuple[Artifact, ...]  # that hold them, one after the other

    @property
    def inputs(self) -> dict[str, Artifact]:
        """Its parts as inputs of what is made from it."""
        return {one.maker: one for one in self.parts}

    def load(self, task: Task) -> Library:
        """All its trajectories."""
        return task.load(*self.parts)


@dataclass(frozen=True)
class ExcitationSet:
    """Trajectories that an arm executes to be identified from."""

    name: str  # of the pool that they were picked from, or of the single long one
    training: int | None  # of the variant; None where nothing was trained
    family: Trajectory
    source: Artifact  # that holds them


def pools(task: Task) -> list[Pool]:
    """The pools of the paper: random ones, the seeds, and the seeds with what each generator made."""
    seeds = seed_set(task)
    grown = [Pool(name, k, (seeds, library(task, name, k))) for name, k in generators(task)]
    return [Pool(RANDOM, None, (random_set(task),)), Pool(SEEDS, None, (seeds,)), *grown]


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
    )


def excitation_sets(task: Task) -> list[ExcitationSet]:
    """Every set that is compared: the single long trajectories, and what was picked from each pool."""
    long = [
        ExcitationSet(f"long-{h}", None, long_family(task, h), long_trajectory(task, h))
        for h in task.cfg.long.harmonics
    ]
    picked = [
        ExcitationSet(one.name, one.training, task.trajectory, selection(task, one)) for one in pools(task)
    ]
    return [*long, *picked]


def pick(task: Task, library: Library) -> Tensor:
    """Indices of the configured pick from a library, in the order of choice, (count,)."""
    return choose(task.cfg.selection, task.body, task.trajectory, library.coefficients, library.diagonal)


def _make(task: Task, build: Build, pool: Pool) -> None:
    library = pool.load(task)
    library.take(pick(task, library)).save(build.folder / LIBRARY)


STAGES = {"selection": Stage(lambda task: [selection(task, pool) for pool in pools(task)])}
