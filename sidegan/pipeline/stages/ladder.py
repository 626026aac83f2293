"""Stage ladder: from the paper's recipe to ours, one change at a time."""

from sidegan.pipeline.graph import Artifact
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.ablation import trained
from sidegan.pipeline.stages.training import needed_surrogates
from sidegan.pipeline.task import Task


def rungs(task: Task) -> dict[str, list[Artifact]]:
    """Every training of each rung."""
    return trained(task, task.cfg.ladder, task.cfg.scale.ladder_trainings)


STAGE = Stage(
    lambda task: [
        *needed_surrogates(task, task.cfg.ladder.values()),
        *(one for trainings in rungs(task).values() for one in trainings),
    ]
)
