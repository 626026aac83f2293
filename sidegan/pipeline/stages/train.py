"""Training of GAN variants, each in a process of its own; stages surrogates and gan use it."""

from functools import partial
from pathlib import Path

from sidegan.base.parallel import Report
from sidegan.base.storage import write_json
from sidegan.gan.variants import Variant
from sidegan.pipeline.plan import GENERATOR, HISTORY, Task
from sidegan.pipeline.stages.common import finite, produce_all, training_seeds


def train_variants(task: Task, variants: dict[str, Variant], trainings: list[int]) -> None:
    """Train each variant so many times, unless it is there."""
    wanted = [(name, settings, k) for name, settings in variants.items() for k in trainings]
    stamps = [task.gan(*one) for one in wanted]
    new = list(dict.fromkeys(one[0] for one, stamp in zip(wanted, stamps) if task.store.find(stamp) is None))
    produce_all(
        task, f"training {', '.join(new)} (%)", stamps, [partial(_train, task, *one) for one in wanted]
    )


def _train(
    task: Task, name: str, settings: Variant, training: int, folder: Path, work: Path, report: Report
) -> None:
    from sidegan.gan.jobs import load_surrogates
    from sidegan.gan.surrogates import Surrogates
    from sidegan.gan.training import Run, train_variant

    surrogates = Surrogates()
    if settings.surrogates:
        source = task.store.require(task.surrogates(settings.data))
        surrogates = load_surrogates(source, settings, task.arm, task.trajectory)
    once = Run(
        name,
        task.number(f"gan {name}", training),
        work,
        evaluation=task.cfg.scale.evaluation,
        device=task.cfg.device,
        epoch_end=lambda epoch, _: report(epoch + 1, settings.epochs),
    )
    seeds = training_seeds(task).coefficients if settings.seeded else None
    trained = train_variant(settings, task.constraints, task.trajectory, seeds, once, surrogates)
    trained.generator.save(folder / GENERATOR)
    write_json(folder / HISTORY, [finite(row) for row in trained.history])
