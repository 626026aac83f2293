"""What is trained: surrogates from seeds and a vanilla generator, generators from seeds and surrogates."""

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
    inputs |= {"surrogates": surrogates(task)} if variant.predicted else {}
    return task.artifact(
        "gan",
        name,
        partial(_train, name=name, training=training, variant=variant),
        (taught(task) if variant.seeded else {})
        | asdict(variant)
        | {"evaluation": task.cfg.scale.evaluation},
        inputs,
        training=training,
        title=f"gan/{title(task, name, training)}",
    )


def surrogates(task: Task) -> Artifact:
    """Success predictor and converters."""
    settings = {key: x for key, x in asdict(task.cfg.surrogates).items() if key != "negatives"}
    inputs = {"seeds": seed_set(task), "negatives": negatives(task)}
    settings |= taught(task)
    return task.artifact("surrogates", "all", _pretrain, settings, inputs, title="surrogates", alone=True)


def needed_surrogates(task: Task, variants: Iterable[Variant]) -> list[Artifact]:
    """The surrogates that some variants learn from, and what these learn from."""
    return [negatives(task), surrogates(task)] if any(one.predicted for one in variants) else []


def negatives(task: Task) -> Artifact:
    """The generator whose output the surrogates learn from, beside the seeds."""
    ((name, variant),) = task.cfg.surrogates.negatives.items()
    return generator(task, name, _NEGATIVES_TRAINING, variant)


def taught(task: Task) -> dict[str, Any]:
    """What is told of the seeds that something learns from, where it is not all of them."""
    return {} if task.cfg.subset is None else {"subset": task.cfg.subset}


def _train(task: Task, build: Build, name: str, training: int, variant: Variant) -> None:
    from sidegan.gan.jobs import load_surrogates
    from sidegan.gan.training import Run, train_variant

    folder = task.store.require(surrogates(task)) if variant.predicted else None
    learnt = load_surrogates(folder, variant, task.arm, task.trajectory)
    run = Run(
        name,
        task.number(f"gan {name}", training),
        build.work,
        task.cfg.scale.evaluation,
        task.cfg.device,
        lambda epoch, _: build.report(epoch + 1, variant.epochs),
    )
    seeds = training_seeds(task).coefficients if variant.seeded else None
    trained = train_variant(variant, task.constraints, task.trajectory, seeds, run, learnt)
    trained.generator.save(build.folder / GENERATOR)
    keep_history(build, trained.history)
    kept = {"kept_epoch": trained.epoch + 1, **trained.history[trained.epoch]}
    write_json(build.folder / REPORT, finite(kept))


def keep_history(build: Build, history: Iterable[Mapping[str, Any]]) -> None:
    """Write the metrics after every epoch; the time that each took [s] is a cost."""
    rows = [finite(row) for row in history]
    seconds = [row.pop("seconds") for row in rows if "seconds" in row]
    if seconds:
        build.costs["epochs"] = seconds
    write_json(build.folder / HISTORY, rows)


def _pretrain(task: Task, build: Build) -> None:
    from sidegan.gan import TrajectoryGenerator
    from sidegan.gan.jobs import SHARES, Pretraining, negatives_count

    settings, workers = task.cfg.surrogates, task.cfg.parallel.workers
    vanilla = TrajectoryGenerator.load(task.store.require(negatives(task)) / GENERATOR, task.arm)
    seeds = training_seeds(task).coefficients
    faulty = vanilla.sample(negatives_count(settings.samples), task.number("negatives"))
    pretraining = Pretraining(task.constraints, task.trajectory, settings, seeds, faulty, build.work)
    labelling: list[Job] = [
        partial(pretraining.label, share, task.number(f"labels {share}")) for share in range(SHARES)
    ]
    run_jobs("labels", labelling, workers, settings.samples)
    trainings: list[Job] = [
        partial(pretraining.train_success, build.folder, task.number("success")),
        *(
            partial(pretraining.train_features, name, build.folder, task.number(name))
            for name in ("spectrum", "diagonal")
        ),
    ]
    parts = run_jobs("surrogates", trainings, workers, settings.epochs * len(trainings))
    write_json(build.folder / REPORT, {key: value for part in parts for key, value in finite(part).items()})
