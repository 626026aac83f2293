"""Stage ladder: from the paper's recipe to ours, one change at a time, and ours without each of its parts."""

from collections.abc import Mapping

from sidegan.gan import Variant
from sidegan.pipeline.graph import Artifact
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.training import generator, needed_surrogates
from sidegan.pipeline.task import Task


def rungs(task: Task) -> dict[str, list[Artifact]]:
    """Every training of each rung."""
    return _trained(task, task.cfg.ladder)


def parts(task: Task) -> dict[str, list[Artifact]]:
    """Every training of ours with one part changed."""
    return _trained(task, task.cfg.ablation)


def _trained(task: Task, variants: Mapping[str, Variant]) -> dict[str, list[Artifact]]:
    trainings = task.cfg.scale.ladder_trainings
    return {name: [generator(task, name, k, one) for k in trainings] for name, one in variants.items()}


STAGE = Stage(
    lambda task: [
        *needed_surrogates(task, (task.cfg.ladder | task.cfg.ablation).values()),
        *(one for trainings in (rungs(task) | parts(task)).values() for one in trainings),
    ]
)
