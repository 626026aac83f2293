"""Stage objectives: exact physics with other objectives, a library and best sets from each."""

from collections.abc import Iterator

from sidegan.pipeline.graph import Artifact
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.best import best_sets
from sidegan.pipeline.stages.library import library
from sidegan.pipeline.stages.pools import own_pools
from sidegan.pipeline.stages.training import generator, generators
from sidegan.pipeline.task import Task


def with_objectives(task: Task) -> Task:
    """The same task with one training of each objective in place of the variants."""
    return task.with_settings(gan=task.cfg.beyond.objectives, trainings=task.cfg.trainings[:1])


def _artifacts(task: Task) -> Iterator[Artifact]:
    other = with_objectives(task)
    yield from (generator(other, *one) for one in generators(other))
    yield from (library(other, *one) for one in generators(other))
    yield from (best_sets(other, pool) for pool in own_pools(other))


STAGE = Stage(_artifacts)
