"""Benchmarks of the networks: generation, generation with validity, training."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import torch

from benchmarks.limits import bandwidth, peak
from benchmarks.setting import Setting
from benchmarks.timing import Row, Timing, cost, medians, rate, threads, timed
from sidegan.design.excitation import excite
from sidegan.gan import TrajectoryGenerator
from sidegan.gan.networks import Generator
from sidegan.gan.scaling import Scaling
from sidegan.gan.surrogates import Converter, SuccessPredictor, Surrogates
from sidegan.gan.training import Run, train_variant
from sidegan.gan.variants import Variant
from sidegan.validity import check

_BATCH = 1000
_PAPER_MICROSECONDS = 1400.0  # per generated trajectory and thread
_PAPER_VALIDATED = 32.0  # generated and checked trajectories per second
_PAPER_TRAINING = 2400.0  # [s]
_PAPER = "the paper"
_WIDTH, _MARGIN_STEPS, _FEATURE_STEPS = 128, 48, 32  # of the surrogates, as configured by default


def generation(setting: Setting) -> Row:
    """Cost of a generated trajectory in batches of 1000 on one thread, of an untrained generator."""
    generator = untrained(setting)
    with threads(1):
        (ours,) = medians(5 * setting.repeats, lambda: generator.sample(_BATCH))
        least = _least_seconds(generator, 1)
    return cost(
        "generation",
        "µs/trajectory",
        1e6 / _BATCH,
        ours,
        _PAPER_MICROSECONDS,
        least * 1e6,
        20.0,
        against=_PAPER,
        limit_is="the weights' products, or their traffic per batch, whichever takes longer",
        threads=1,
    )


def generate_validate(setting: Setting) -> Row:
    """Generated trajectories, each with its validity proven or refuted, per second on two threads."""
    generator, count = untrained(setting), setting.size(2000)

    def work() -> None:
        check(setting.constraints, setting.trajectory, generator.sample(count))

    with threads(2):
        (ours,) = medians(setting.repeats, work)
    return rate(
        "generate_validate",
        "trajectories/s",
        count,
        ours,
        _PAPER_VALIDATED,
        1 / _least_seconds(generator, 2),
        2500.0,
        against=_PAPER,
        limit_is="the generator alone, at the limit of the row above",
        threads=2,
    )


def training(setting: Setting) -> Row:
    """Seconds of the slowest variant's training on two threads, from a few of its epochs.

    With untrained surrogates, which cost the same, and the true physics of a thousand trajectories
    after every epoch.
    """
    epochs, seeds = (1, 200) if setting.quick else (5, 1800)
    runs: dict[str, Timing] = {}
    for name, variant in setting.variants().items():
        few = replace(variant, epochs=epochs, fitness_start=0)
        with threads(2):
            run = timed(lambda few=few: _train(setting, few, seeds))  # type: ignore[misc]
        runs[name] = Timing(*(part * variant.epochs / epochs for part in run))
    return cost(
        "training",
        "s",
        1.0,
        max(runs.values()),
        _PAPER_TRAINING,
        None,
        90.0,
        against=_PAPER,
        limit_is="",
        threads=2,
        also={f"{name}, scaled from {epochs} epochs": run.wall for name, run in runs.items()},
    )


def untrained(setting: Setting) -> TrajectoryGenerator:
    """A generator of the default size that yields the Gaussian of random trajectories."""
    seeds = setting.start(200)
    scaling = Scaling.fit(seeds)
    network = Generator(*setting.trajectory.shape[:2], shortcut=True)
    network.start_from(scaling.image(seeds))
    arm = setting.arm
    return TrajectoryGenerator(network.eval(), scaling, setting.trajectory, arm.name, arm.digest, "untrained")


def _least_seconds(generator: TrajectoryGenerator, count: int) -> float:
    """Seconds per trajectory that the weights' products or their traffic take in a batch."""
    weights = [x for x in generator.network.parameters() if x.ndim > 1]
    products = 2 * sum(x.numel() for x in weights) / peak(count, torch.float32)
    return max(products, sum(x.nbytes for x in weights) / bandwidth(count) / _BATCH)


def _train(setting: Setting, variant: Variant, count: int) -> None:
    seeds = setting.start(count)
    predictor = converter = None
    if variant.surrogates:
        names = len(setting.constraints.labels)
        predictor = SuccessPredictor(setting.arm, setting.trajectory, names, _WIDTH, _MARGIN_STEPS)
        predictor.eval().requires_grad_(False)
    if variant.features != "none":
        excitation = excite(setting.body, setting.trajectory, seeds[:200])
        features = excitation.spectrum if variant.features == "spectrum" else excitation.diagonal
        converter = Converter(setting.arm, setting.trajectory, features.shape[1], _WIDTH, _FEATURE_STEPS)
        converter.fit_standard(features)
        converter.eval().requires_grad_(False)
    with TemporaryDirectory() as work:
        run = Run("timed", 0, Path(work), evaluation=setting.size(1000))
        surrogates = Surrogates(predictor, converter)
        train_variant(variant, setting.constraints, setting.trajectory, seeds, run, surrogates)
