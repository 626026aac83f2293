"""Pools of trajectories that sets are picked from, and the excitation sets that are compared."""

from dataclasses import dataclass

from sidegan.library import Library
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.graph import Artifact
from sidegan.pipeline.stages.library import library
from sidegan.pipeline.stages.long import long_family, long_trajectory
from sidegan.pipeline.stages.random import random_set
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.training import generators, title
from sidegan.pipeline.task import Task

RANDOM, SEEDS = "random", "seeds"


@dataclass(frozen=True)
class Pool:
    """Trajectories that a set can be picked from.

    Attributes:
        name: of whoever made them: ``random``, ``seeds``, or a variant.
        training: of the variant; None where nothing was trained.
        title: its name for people.
        parts: the artifacts that hold them, one after the other.
    """

    name: str
    training: int | None
    title: str
    parts: tuple[Artifact, ...]

    @property
    def inputs(self) -> dict[str, Artifact]:
        """Its parts as inputs of what is made from it."""
        return {one.maker: one for one in self.parts}

    def load(self, task: Task) -> Library:
        """All its trajectories.

        Raises:
            ArtifactError: when a part is not there.
        """
        first, *others = (task.load(one) for one in self.parts)
        return first.merge(*others)


def pools(task: Task) -> list[Pool]:
    """The pools of the paper: random ones, the seeds, and the seeds with what each generator made."""
    seeds = seed_set(task)
    grown = [_pool(task, *one, (seeds, library(task, *one))) for one in generators(task)]
    return [_pool(task, RANDOM, None, (random_set(task),)), _pool(task, SEEDS, None, (seeds,)), *grown]


def _pool(task: Task, name: str, training: int | None, parts: tuple[Artifact, ...]) -> Pool:
    return Pool(name, training, title(task, name, training), parts)


@dataclass(frozen=True)
class ExcitationSet:
    """Trajectories that an arm executes to be identified from.

    Attributes:
        name: of the pool that they were picked from, or of the single long one.
        training: of the variant; None where nothing was trained.
        title: its name for people.
        family: of the trajectories.
        source: the artifact that holds them.
        harmonics: of a single long trajectory; None for a set of short ones.
    """

    name: str
    training: int | None
    title: str
    family: Trajectory
    source: Artifact
    harmonics: int | None = None


def long_sets(task: Task) -> list[ExcitationSet]:
    """The single long trajectory in each of its readings."""
    return [
        ExcitationSet(name, None, name, long_family(task, h), long_trajectory(task, h), h)
        for h, name in ((h, f"long-{h}") for h in task.cfg.long.harmonics)
    ]
