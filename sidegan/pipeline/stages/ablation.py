"""Stage ablation: variants that differ from the recipe in one part, and the paper's own recipe."""

from sidegan.pipeline.graph import Artifact
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.training import generator, needed_surrogates
from sidegan.pipeline.task import Task


def ablated(task: Task) -> dict[str, list[Artifact]]:
    """Every training of each variant of the ablation."""
    trainings = task.cfg.scale.ablation_trainings
    return {
        name: [generator(task, name, training, variant) for training in trainings]
        for name, variant in task.cfg.ablation.items()
    }


STAGE = Stage(
    lambda task: [
        *needed_surrogates(task, task.cfg.ablation.values()),
        *(one for trainings in ablated(task).values() for one in trainings),
    ]
)
