"""Stages surrogates, gan, subsets: success predictor and converters, variants, and both on fewer seeds."""

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import torch

from sidegan.base.extras import require
from sidegan.base.parallel import Job, run_jobs
from sidegan.base.storage import read_torch, reading, write_json, write_torch
from sidegan.gan import Variant
from sidegan.gan.settings import PublishedSurrogates, SurrogateSettings
from sidegan.library import Library
from sidegan.pipeline.artifact import Artifact, Build
from sidegan.pipeline.stage import Stage, finite
from sidegan.pipeline.stages.seeds import FEATURES, seed_set
from sidegan.pipeline.store import file_digest
from sidegan.pipeline.task import GENERATOR, HISTORY, REPORT, Task
from sidegan.seeds.published import WEIGHTS, Layout

_CHECKED = 500  # trajectories whose validity is found at once
SAMPLES = "samples.pt"  # of every epoch
log = logging.getLogger(__name__)
_NEGATIVES_TRAINING = 0  # of the generator whose output the surrogates learn from


def training_seeds(task: Task) -> Library:
    """The seeds that surrogates and generators learn from."""
    seeds = task.load(seed_set(task))
    return seeds if task.cfg.subset is None else seeds.take(range(min(task.cfg.subset, len(seeds))))


def generators(task: Task) -> list[tuple[str, int]]:
    """Name and training of every generator."""
    return [(name, training) for name in task.cfg.gan for training in task.cfg.trainings]


def generator(task: Task, name: str, training: int, variant: Variant | None = None) -> Artifact:
    """A trained variant; one of the configured ones where none is given."""
    variant = variant or task.cfg.gan[name]
    samples = _samples(task, variant)
    inputs: dict[str, Artifact | str] = {"seeds": seed_set(task)} if variant.seeded else {}
    inputs |= {"surrogates": surrogates(task)} if variant.features else {}
    if start := _start(task, variant):
        with reading(start, "generator"):
            inputs |= {"start": file_digest(start)}
    return task.artifact(
        "gan",
        name,
        partial(_train, name=name, training=training, variant=variant),
        (taught(task) if variant.seeded else {})
        | asdict(variant)
        | {"evaluation": task.cfg.evaluation, "box": _box(task, variant)}
        | ({"samples": samples} if samples else {}),
        inputs,
        training=training,
    )


def _start(task: Task, variant: Variant) -> Path | None:
    """File of the generator from whose network a variant starts: of those with surrogates."""
    ours = variant.features and variant.published is None
    return Path(task.cfg.start).expanduser() if task.cfg.start is not None and ours else None


def _box(task: Task, variant: Variant) -> float | None:
    """Largest absolute coefficient [rad/s] that a generator may yield; None where it may yield any."""
    return task.cfg.seeds.box if variant.boxed else None


def _samples(task: Task, variant: Variant) -> int:
    """How many samples of each epoch a training leaves: published surrogates learn from a vanilla GAN's."""
    faulty = variant.published is not None and not variant.features
    return -(-task.cfg.surrogates.samples // variant.epochs) if faulty else 0


def surrogates(task: Task) -> Artifact:
    """Success predictor and converters."""
    chosen = task.cfg.surrogates
    settings = {key: x for key, x in asdict(chosen).items() if key != "negatives"} | taught(task)
    inputs = {"seeds": seed_set(task), "negatives": negatives(task)}
    make: Callable[[Task, Build], None]
    if isinstance(chosen, PublishedSurrogates):
        make, label = partial(_pretrain_published, settings=chosen), "published"
    else:
        make, label = partial(_pretrain, settings=chosen), "all"
    return task.artifact("surrogates", label, make, settings, inputs, title="surrogates", alone=True)


def needed_surrogates(task: Task, variants: Iterable[Variant]) -> list[Artifact]:
    """The surrogates that some variants learn from, and what these learn from."""
    return [negatives(task), surrogates(task)] if any(one.features for one in variants) else []


def negatives(task: Task) -> Artifact:
    """The generator whose output the surrogates learn from, beside the seeds."""
    ((name, variant),) = task.cfg.surrogates.negatives.items()
    return generator(task, name, _NEGATIVES_TRAINING, variant)


def taught(task: Task) -> dict[str, Any]:
    """Settings of a subset of the seeds, where something does not learn from all of them."""
    return {} if task.cfg.subset is None else {"subset": task.cfg.subset}


def _train(task: Task, build: Build, name: str, training: int, variant: Variant) -> None:
    from sidegan.gan.pretraining import load_surrogates
    from sidegan.gan.side_gan import Data
    from sidegan.gan.training import Run, random_trajectories, train

    seed, evaluation = task.number(f"gan {name}", training), task.cfg.evaluation
    box = _box(task, variant)
    if variant.seeded:
        seeds = training_seeds(task).coefficients
        task.cfg.seeds.refuse_beyond(seeds)
    else:
        seeds = random_trajectories(task.constraints, task.trajectory, seed, box)
    data = Data(task.constraints, task.trajectory, seeds, box=box, start=_start(task, variant))
    if variant.features:
        folder = task.store.require(surrogates(task))
        predictor, converter = load_surrogates(folder, variant, task.arm, task.trajectory)
        data = replace(data, success_predictor=predictor, converter=converter)
    samples, device = _samples(task, variant), task.cfg.device
    trained = train(variant, data, Run(name, seed, build.work, evaluation, samples, device, build.report))
    trained.generator.save(build.folder / GENERATOR)
    if samples:
        write_torch(build.folder / SAMPLES, trained.samples)
    write_json(build.folder / HISTORY, [finite(row) for row in trained.history])
    write_json(build.folder / REPORT, finite(trained.history[-1]))


def _pretrain_published(task: Task, build: Build, settings: PublishedSurrogates) -> None:
    from sidegan.gan.published_surrogates import PublishedPretraining, write_converter

    seeds, samples = training_seeds(task), read_torch(task.store.require(negatives(task)) / SAMPLES)
    theirs = task.store.require(seed_set(task)) / FEATURES
    diagonal = read_torch(theirs)[: len(seeds)] if theirs.exists() else seeds.diagonal
    features, weights = {"spectrum": seeds.spectrum, "diagonal": diagonal}, None
    if settings.shipped:  # of the predictor and of the converter to the eigenvalues
        shipped = task.cfg.seeds.published.weights
        weights = shipped("predictor")
        write_converter(build.folder / "spectrum.pt", shipped("converter"))
        del features["spectrum"]
    layout = Layout(task.trajectory.joints, task.trajectory.harmonics)
    parts = layout.coefficients(samples.double()).split(_CHECKED)
    valid = torch.cat([task.check(part).valid for part in parts])
    pretraining = PublishedPretraining(settings.steps, layout.image(seeds.coefficients), samples, valid)
    jobs: list[Job] = [partial(pretraining.train_success, build.folder, task.number("success"), weights)]
    for name, x in features.items():
        jobs.append(partial(pretraining.train_features, name, x, build.folder, task.number(name)))
    _report(build, run_jobs("surrogates", jobs, task.cfg.parallel.workers, len(jobs)))


def _pretrain(task: Task, build: Build, settings: SurrogateSettings) -> None:
    from sidegan.gan import TrajectoryGenerator
    from sidegan.gan.labels import Labelled
    from sidegan.gan.pretraining import SHARES, Pretraining, negatives_count

    workers = task.cfg.parallel.workers
    vanilla = TrajectoryGenerator.load(task.store.require(negatives(task)) / GENERATOR, task.arm)
    seeds = training_seeds(task).coefficients
    faulty = vanilla.sample(negatives_count(settings.samples), task.number("negatives"))
    pretraining = Pretraining(task.constraints, task.trajectory, settings, seeds, faulty)
    shares = [partial(pretraining.label, task.number(f"labels {share}")) for share in range(SHARES)]
    labelled = Labelled.join(run_jobs("labels", shares, workers, settings.samples))
    jobs: list[Job] = [partial(pretraining.train_success, labelled, build.folder, task.number("success"))]
    for name in ("spectrum", "diagonal", "energies"):
        jobs.append(partial(pretraining.train_features, name, labelled, build.folder, task.number(name)))
    _report(build, run_jobs("surrogates", jobs, workers, settings.epochs * len(jobs)))


def _report(build: Build, parts: Iterable[Mapping[str, Any]]) -> None:
    write_json(build.folder / REPORT, {key: value for part in parts for key, value in finite(part).items()})


def on_subset(task: Task, size: int) -> Task:
    """A task that trains on so many of the seeds; on all of them it is the task itself."""
    if size >= task.cfg.seeds.count:
        return task
    variants = {name: one for name, one in task.cfg.gan.items() if one.features} or task.cfg.gan
    return task.with_settings(subset=size, gan=variants, trainings=task.cfg.discussion.trainings)


def _subsets(task: Task) -> Iterator[Artifact]:
    for size in task.cfg.discussion.sizes:
        smaller = on_subset(task, size)
        yield from needed_surrogates(smaller, smaller.cfg.gan.values())
        yield from _gan(smaller)


def _gan(task: Task) -> list[Artifact]:
    return [generator(task, *one) for one in generators(task)]


def _surrogates(task: Task) -> list[Artifact]:
    needed = needed_surrogates(task, task.cfg.gan.values())
    if not needed:
        log.info("no surrogates: none of %s learns from them", ", ".join(task.cfg.gan))
    return needed


def _check(task: Task) -> None:
    """Refuse to begin without what trains."""
    require("paper", "pytorch_lightning")


def _check_surrogates(task: Task) -> None:
    """Refuse a folder without the weights that are wanted from it, too."""
    _check(task)
    chosen = task.cfg.surrogates
    if isinstance(chosen, PublishedSurrogates) and chosen.shipped:
        for name in WEIGHTS:
            task.cfg.seeds.published.weights(name)


STAGES = {
    "surrogates": Stage(_surrogates, check=_check_surrogates),
    "gan": Stage(_gan, check=_check),
    "subsets": Stage(_subsets, check=_check),
}
