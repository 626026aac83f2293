"""Training of GAN variants, each in a process of its own; stages surrogates and gan use it."""

from functools import partial
from pathlib import Path

from sidegan.base.parallel import Report
from sidegan.base.storage import write_json
from sidegan.pipeline.config import GanVariant
from sidegan.pipeline.plan import GENERATOR, HISTORY, Task, variant
from sidegan.pipeline.stages.common import finite, produce_all, training_seeds


def train_variants(task: Task, variants: dict[str, GanVariant], trainings: list[int]) -> None:
    """Train each variant so many times, unless it is there."""
    wanted = [(name, settings, k) for name, settings in variants.items() for k in trainings]
    stamps = [task.gan(*one) for one in wanted]
    new = list(dict.fromkeys(one[0] for one, stamp in zip(wanted, stamps) if task.store.find(stamp) is None))
    produce_all(
        task, f"training {', '.join(new)} (%)", stamps, [partial(_train, task, *one) for one in wanted]
    )


def _train(
    task: Task, name: str, settings: GanVariant, training: int, folder: Path, work: Path, report: Report
) -> None:
    from sidegan.gan import jobs
    from sidegan.gan.training import train_variant

    wanted = variant(name, settings)
    predictor = converter = None
    if wanted.surrogates:
        source = task.store.require(task.surrogates(settings.data))
        predictor = jobs.load_predictor(source, task.arm, task.trajectory)
        if wanted.features != "none":
            converter = jobs.load_converter(source, wanted.features, task.arm, task.trajectory)
    trained = train_variant(
        wanted,
        task.constraints,
        task.trajectory,
        training_seeds(task).coefficients if wanted.seeded else None,
        work,
        seed=task.number(f"gan {name}", training),
        evaluation=task.cfg.scale.evaluation,
        predictor=predictor,
        converter=converter,
        device=task.cfg.device,
        epoch_end=lambda epoch, _: report(epoch + 1, wanted.epochs),
    )
    trained.generator.save(folder / GENERATOR)
    write_json(folder / HISTORY, [finite(row) for row in trained.history])
