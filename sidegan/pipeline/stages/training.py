"""Stages surrogates, gan and subsets: success predictor and converters, variants, both on fewer seeds."""

from collections.abc import Callable, Iterator
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from sidegan.base.arrays import split
from sidegan.base.extras import extra, require
from sidegan.base.parallel import Job, run_jobs
from sidegan.base.storage import finite, read_arrays, write_arrays, write_json, write_mlmodel
from sidegan.gan.settings import PublishedSurrogates, SurrogateSettings, Variant
from sidegan.library import Library
from sidegan.pipeline.artifact import Artifact, Build
from sidegan.pipeline.context import GENERATOR, HISTORY, REPORT, RunContext
from sidegan.pipeline.stages import Stage
from sidegan.pipeline.stages.seeds import FEATURES, seed_set
from sidegan.seeding import refuse_beyond
from sidegan.seeding.published import WEIGHTS, Layout

if TYPE_CHECKING:  # imports torch
    from sidegan.gan.generator import TrajectoryGenerator

_CHECKED = 500  # trajectories per validity check
EPOCH_SAMPLES = "samples.npz"  # of every epoch
_NEGATIVES_TRAINING = 0  # training of the generator whose samples the surrogates learn from


def training_seeds(run: RunContext) -> Library:
    """The seeds that surrogates and generators learn from."""
    seeds = run.load(seed_set(run))
    return seeds if run.cfg.subset is None else seeds.take(range(min(run.cfg.subset, len(seeds))))


def generators(run: RunContext) -> list[tuple[str, int]]:
    """Name and training of every generator."""
    return [(name, training) for name in run.cfg.gan for training in run.cfg.trainings]


def generator(run: RunContext, name: str, training: int, variant: Variant | None = None) -> Artifact:
    """A trained variant, by default the configured one of this name."""
    variant = variant or run.cfg.gan[name]
    box = run.cfg.seeds.box if variant.generator.boxed else None  # of absolute coefficients [rad/s]
    inputs: dict[str, Artifact | str] = {}
    settings: dict[str, Any] = {}
    if variant.seeded:
        inputs["seeds"] = seed_set(run)
        settings |= taught(run)
    if variant.features:
        inputs["surrogates"] = surrogate_networks(run)
    settings |= variant.stamped() | {"evaluation": run.cfg.evaluation, "box": box}
    samples = 0  # to keep of each epoch: published surrogates learn from a vanilla GAN's samples
    if variant.generator.network == "convolutional" and not variant.features:
        settings["samples"] = samples = -(-run.cfg.surrogates.samples // variant.epochs)
    make = partial(_train, name=name, training=training, variant=variant, box=box, samples=samples)
    return run.artifact("gan", name, make, settings, inputs, training=training)


def load_generator(run: RunContext, made: Artifact) -> "TrajectoryGenerator":
    """The generator of an artifact, which must exist."""
    with extra("paper"):
        from sidegan.gan.generator import TrajectoryGenerator
        from sidegan.gan.tensors import keep_freed_memory

    keep_freed_memory()
    return TrajectoryGenerator.load(run.store.require(made) / GENERATOR, run.cell.arm)


def surrogate_networks(run: RunContext) -> Artifact:
    """Success predictor and converters."""
    chosen = run.cfg.surrogates
    settings = {key: x for key, x in asdict(chosen).items() if key != "negatives"} | taught(run)
    inputs = {"seeds": seed_set(run), "negatives": negatives(run)}
    make: Callable[[RunContext, Build], None]
    if isinstance(chosen, PublishedSurrogates):
        label, make = "published", partial(_pretrain_published, settings=chosen)
    else:
        label, make = "all", partial(_pretrain, settings=chosen)
    return run.artifact("surrogates", label, make, settings, inputs, title="surrogates", alone=True)


def needed_surrogates(run: RunContext) -> list[Artifact]:
    """The surrogates that a run's variants learn from, and the generator that these learn from."""
    needed = any(variant.features for variant in run.cfg.gan.values())
    return [negatives(run), surrogate_networks(run)] if needed else []


def negatives(run: RunContext) -> Artifact:
    """The generator whose samples the surrogates learn from, in addition to the seeds."""
    ((name, variant),) = run.cfg.surrogates.negatives.items()
    return generator(run, name, _NEGATIVES_TRAINING, variant)


def taught(run: RunContext) -> dict[str, Any]:
    """Settings of an artifact that learns from the seeds: the subset, unless it is all of them."""
    return {} if run.cfg.subset is None else {"subset": run.cfg.subset}


def _train(
    run: RunContext,
    build: Build,
    name: str,
    training: int,
    variant: Variant,
    box: float | None,
    samples: int,
) -> None:
    from sidegan.gan.training import TrainingRun
    from sidegan.steps.train import trained

    seeds = training_seeds(run).coefficients if variant.seeded else None
    if seeds is not None:
        refuse_beyond(seeds, run.cfg.seeds.box)
    folder = run.store.require(surrogate_networks(run)) if variant.features else None
    how = TrainingRun(
        name,
        run.number(f"gan {name}", training),
        build.work,
        evaluation=run.cfg.evaluation,
        samples=samples,
        trainer=run.cfg.trainer,
        progress=build.report,
        logger=None if run.store.curves is None else run.store.curves.logger(f"gan/{name}-{training}"),
    )
    made = trained(run.cell, variant, seeds, how, surrogates=folder, box=box)
    made.generator.save(build.folder / GENERATOR)
    write_mlmodel(build.folder, loader_module="sidegan.gan.generator", data=GENERATOR)
    if samples:
        write_arrays(build.folder / EPOCH_SAMPLES, {"images": made.samples})
    write_json(build.folder / HISTORY, [finite(row) for row in made.history])
    write_json(build.folder / REPORT, finite(made.history[-1]))


def _pretrain_published(run: RunContext, build: Build, settings: PublishedSurrogates) -> None:
    from sidegan.gan.published import PublishedPretraining, read_weights, write_converter

    seeds = training_seeds(run)
    samples = read_arrays(run.store.require(negatives(run)) / EPOCH_SAMPLES)["images"]
    published = run.store.require(seed_set(run)) / FEATURES
    diagonal = read_arrays(published)["diagonal"][: len(seeds)] if published.exists() else seeds.diagonal
    features = {"spectrum": seeds.spectrum, "diagonal": diagonal}
    weights = None
    if settings.shipped:  # the authors' predictor, and their converter to the eigenvalues
        shipped = run.cfg.seeds.published.weights
        weights = read_weights(shipped("predictor"))
        write_converter(build.folder / "spectrum.pt", read_weights(shipped("converter")))
        del features["spectrum"]
    layout = Layout(run.cell.trajectory.joints, run.cell.trajectory.harmonics)
    parts = split(layout.coefficients(samples.astype(float)), _CHECKED)
    valid = np.concatenate([run.cell.check(part).valid for part in parts])
    pretraining = PublishedPretraining(settings.steps, layout.image(seeds.coefficients), samples, valid)
    jobs: list[Job] = [partial(pretraining.train_success, build.folder, run.number("success"), weights)]
    for name, x in features.items():
        jobs.append(partial(pretraining.train_features, name, x, build.folder, run.number(name)))
    report: dict[str, Any] = {}
    for part in run_jobs("surrogates", jobs, run.cfg.parallel.workers, len(jobs)):
        report |= finite(part)
    write_json(build.folder / REPORT, report)


def _pretrain(run: RunContext, build: Build, settings: SurrogateSettings) -> None:
    from sidegan.steps.train import pretrain

    vanilla, seeds = load_generator(run, negatives(run)), training_seeds(run).coefficients
    workers = run.cfg.parallel.workers
    report = pretrain(run.cell, seeds, vanilla, settings, build.folder, seed=run.cfg.seed, workers=workers)
    write_json(build.folder / REPORT, finite(report))


def on_subset(run: RunContext, size: int) -> RunContext:
    """The run that trains on ``size`` of the seeds; the run itself if it does."""
    if size == (run.cfg.subset or run.cfg.seeds.count):
        return run
    variants = {name: variant for name, variant in run.cfg.gan.items() if variant.features} or run.cfg.gan
    return run.with_settings(subset=size, gan=variants, trainings=run.cfg.discussion.trainings)


def _subsets(run: RunContext) -> Iterator[Artifact]:
    for size in run.cfg.discussion.sizes:
        smaller = on_subset(run, size)
        yield from needed_surrogates(smaller)
        yield from _gan(smaller)


def _gan(run: RunContext) -> list[Artifact]:
    return [generator(run, name, training) for name, training in generators(run)]


def _check(run: RunContext) -> None:
    """Refuse to begin without the packages for training."""
    require("paper", "pytorch_lightning")


def _check_surrogates(run: RunContext) -> None:
    """Also refuse a folder of published weights that lacks some."""
    _check(run)
    chosen = run.cfg.surrogates
    if isinstance(chosen, PublishedSurrogates) and chosen.shipped:
        for name in WEIGHTS:
            run.cfg.seeds.published.weights(name)


STAGES = {
    "surrogates": Stage(needed_surrogates, check=_check_surrogates),
    "gan": Stage(_gan, check=_check),
    "subsets": Stage(_subsets, check=_check),
}
