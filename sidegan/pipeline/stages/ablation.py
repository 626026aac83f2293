"""Stage ablation: variants that differ from the recipe in one part, and the paper's own recipe."""

from collections.abc import Iterable, Mapping

from sidegan.gan import Variant
from sidegan.pipeline.graph import Artifact
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.training import generator, needed_surrogates
from sidegan.pipeline.task import Task


def trained(
    task: Task, variants: Mapping[str, Variant], trainings: Iterable[int]
) -> dict[str, list[Artifact]]:
    """Every training of each variant."""
    return {
        name: [generator(task, name, training, variant) for training in trainings]
        for name, variant in variants.items()
    }


STAGE = Stage(
    lambda task: [
        *needed_surrogates(task, task.cfg.ablation.values()),
        *(
            one
            for some in trained(task, task.cfg.ablation, task.cfg.scale.ablation_trainings).values()
            for one in some
        ),
    ]
)
