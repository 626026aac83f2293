"""Stage subsets: surrogates and variants on fewer seeds."""

from collections.abc import Iterator

from sidegan.pipeline.graph import Artifact
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.training import generator, generators, needed_surrogates
from sidegan.pipeline.task import Task


def on_subset(task: Task, size: int) -> Task:
    """A task that trains on so many of the seeds; on all of them it is the task itself."""
    if size >= task.cfg.seeds.count:
        return task
    variants = {name: one for name, one in task.cfg.gan.items() if one.features} or task.cfg.gan
    return task.with_settings(subset=size, gan=variants, trainings=task.cfg.scale.side_trainings)


def _artifacts(task: Task) -> Iterator[Artifact]:
    for size in task.cfg.discussion.sizes:
        smaller = on_subset(task, size)
        yield from needed_surrogates(smaller, smaller.cfg.gan.values())
        yield from (generator(smaller, *one) for one in generators(smaller))


STAGE = Stage(_artifacts)
