"""What is trained: surrogates from the seeds and a vanilla generator, and generators from seeds and surrogates."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from functools import partial
from typing import Any

from sidegan.base.parallel import Job, run_jobs
from sidegan.base.storage import write_json
from sidegan.gan import Variant
from sidegan.library import Library
from sidegan.pipeline.graph import Artifact, Build
from sidegan.pipeline.stage import finite
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.task import GENERATOR, HISTORY, REPORT, Task

LABEL_SHARES = 8
_NEGATIVES_TRAINING = 0  # of the generator whose output the surrogates learn from


def training_seeds(task: Task) -> Library:
    """The seeds that surrogates and generators learn from."""
    seeds = task.load(seed_set(task))
    return seeds if task.cfg.subset is None else seeds.take(range(min(task.cfg.subset, len(seeds))))


def title(task: Task, name: str, training: int | None) -> str:
    """Name of a variant, pool or set for people; the training is told where there are several."""
    return name if training is None or len(task.cfg.trainings) == 1 else f"{name}-{training}"


def generators(task: Task) -> list[tuple[str, int]]:
    """Name and training of every generator."""
    return [(name, training) for name in task.cfg.gan for training in task.cfg.trainings]


def generator(task: Task, name: str, training: int, variant: Variant | None = None) -> Artifact:
    """A trained variant; one of the configured ones where none is given."""
    variant = variant or task.cfg.gan[name]
    inputs = {"seeds": seed_set(task)} if variant.seeded else {}
    if variant.surrogates:
        inputs["surrogates"] = surrogates(task, variant.data)
    return task.artifact(
        "gan",
        name,
        partial(_train, name=name, training=training, variant=variant),
        (taught(task) if variant.seeded else {})
        | asdict(variant)
        | {"evaluation": task.cfg.scale.evaluation},
        inputs,
        training=training,
        title=title(task, name, training),
    )


def surrogates(task: Task, data: str) -> Artifact:
    """Success predictor and converters that learn from ``broad`` samples, or from those of the ``paper``."""
    settings = asdict(task.cfg.surrogates) | {"data": data}
    del settings["negatives"]
    inputs = {"seeds": seed_set(task), "negatives": negatives(task)}
    make = partial(_pretrain, data=data)
    settings |= taught(task)
    return task.artifact("surrogates", data, make, settings, inputs, title=f"surrogates {data}", alone=True)


def needed_surrogates(task: Task, variants: Iterable[Variant]) -> list[Artifact]:
    """The surrogates that some variants learn from, and what these learn from."""
    data = {one.data for one in variants if one.surrogates}
    return [negatives(task), *(surrogates(task, one) for one in sorted(data))] if data else []


def negatives(task: Task) -> Artifact:
    """The generator whose output the surrogates learn from, beside the seeds."""
    ((name, variant),) = task.cfg.surrogates.negatives.items()
    return generator(task, name, _NEGATIVES_TRAINING, variant)


def taught(task: Task) -> dict[str, Any]:
    """What is told of the seeds that something learns from, where it is not all of them."""
    return {} if task.cfg.subset is None else {"subset": task.cfg.subset}


def _train(task: Task, build: Build, name: str, training: int, variant: Variant) -> None:
    from sidegan.gan import jobs
    from sidegan.gan.training import train_variant

    predictor = converter = None
    if variant.surrogates:
        source = task.store.require(surrogates(task, variant.data))
        predictor = jobs.load_predictor(source, task.arm, task.trajectory)
        if variant.features != "none":
            converter = jobs.load_converter(source, variant.features, task.arm, task.trajectory)
    trained = train_variant(
        variant,
        task.constraints,
        task.trajectory,
        training_seeds(task).coefficients if variant.seeded else None,
        build.work,
        seed=task.number(f"gan {name}", training),
        evaluation=task.cfg.scale.evaluation,
        predictor=predictor,
        converter=converter,
        device=task.cfg.device,
        epoch_end=lambda epoch, _: build.report(epoch + 1, variant.epochs),
    )
    trained.generator.save(build.folder / GENERATOR)
    keep_history(build, trained.history)


def keep_history(build: Build, history: Iterable[Mapping[str, Any]]) -> None:
    """Write the metrics after every epoch; the time that each took [s] is a cost."""
    rows = [finite(row) for row in history]
    seconds = [row.pop("seconds") for row in rows if "seconds" in row]
    if seconds:
        build.costs["epochs"] = seconds
    write_json(build.folder / HISTORY, rows)


def _pretrain(task: Task, build: Build, data: str) -> None:
    from sidegan.gan import TrajectoryGenerator, jobs

    settings, workers, physics = (
        task.cfg.surrogates,
        task.cfg.parallel.workers,
        (task.constraints, task.trajectory),
    )
    vanilla = TrajectoryGenerator.load(task.store.require(negatives(task)) / GENERATOR, task.arm)
    faulty = vanilla.sample(jobs.negatives_wanted(settings.samples), task.number("negatives"))
    seeds = training_seeds(task).coefficients
    taught = (jobs.training_seeds(seeds)[0], jobs.training_negatives(faulty)[0])
    count, steps = -(-settings.samples // LABEL_SHARES), settings.margin_steps
    shares = [build.work / f"labels-{i}.pt" for i in range(LABEL_SHARES)]
    labelling: list[Job] = [
        partial(jobs.label_share, *physics, *taught, count, steps, data, path, task.number(f"labels {i}"))
        for i, path in enumerate(shares)
    ]
    run_jobs("labels", labelling, workers, settings.samples)
    sizes, epochs = jobs.Sizes(settings.width, steps, settings.feature_steps), settings.epochs
    rest = (shares, sizes, epochs, build.folder)
    trainings: list[Job] = [
        partial(jobs.train_success, *physics, seeds, faulty, *rest, task.number("success")),
        *(
            partial(jobs.train_features, task.arm, task.trajectory, name, *rest, task.number(name))
            for name in ("spectrum", "diagonal")
        ),
    ]
    parts = run_jobs("surrogates", trainings, workers, epochs * len(trainings))
    write_json(build.folder / REPORT, {key: value for part in parts for key, value in finite(part).items()})
