"""Stage few_seeds: exact variants in the style of ever fewer seeds."""

from sidegan.pipeline.graph import Artifact
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.training import generator, generators
from sidegan.pipeline.task import Task


def few_sizes(task: Task) -> list[int]:
    """Numbers of seeds, ascending; the last is all of them."""
    whole = task.cfg.seeds.count
    return [*sorted(size for size in task.cfg.beyond.sizes if size < whole), whole]


def on_few(task: Task, size: int) -> Task:
    """The same task with one training of the variants for few seeds, on so many of them."""
    subset = size if size < task.cfg.seeds.count else None
    return task.with_settings(gan=task.cfg.beyond.few_seeds, trainings=task.cfg.trainings[:1], subset=subset)


def trained_on_few(task: Task, size: int) -> list[Artifact]:
    """The generators that learnt from so many seeds."""
    few = on_few(task, size)
    return [generator(few, *one) for one in generators(few)]


STAGE = Stage(lambda task: [one for size in few_sizes(task) for one in trained_on_few(task, size)])
