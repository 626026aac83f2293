"""Benchmarks of the networks: generation, generation with validity, training."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.setting import Setting
from benchmarks.timing import Result, Timing, medians, timed
from sidegan.design.excitation import excite
from sidegan.gan.surrogates import Converter, SuccessPredictor, Surrogates
from sidegan.gan.training import Run, train_variant
from sidegan.gan.variants import Variant
from sidegan.pipeline.run import composed
from sidegan.validity import check

_BATCH = 1000
_PAPER_MICROSECONDS = 1400.0  # per generated trajectory and thread
_PAPER_VALIDATED = 32.0  # generated and checked trajectories per second
_PAPER_TRAINING = 2400.0  # [s]
_WIDTH, _MARGIN_STEPS, _FEATURE_STEPS = 128, 48, 32  # of the surrogates, as configured by default


def generation(setting: Setting) -> Result:
    """Cost of a generated trajectory in batches of 1000 on one thread, of an untrained generator."""
    generator = setting.untrained()
    (run,) = medians(5 * setting.repeats, lambda: generator.sample(_BATCH))
    return Result(run, 1e6 / _BATCH, _PAPER_MICROSECONDS)


def generate_validate(setting: Setting) -> Result:
    """Generated trajectories, each with its validity proven or refuted, per second on two threads."""
    generator, count = setting.untrained(), setting.size(2000)
    proof = partial(check, setting.problem.constraints, setting.problem.trajectory)
    (run,) = medians(setting.repeats, lambda: proof(generator.sample(count)))
    return Result(run, count, _PAPER_VALIDATED)


def training(setting: Setting) -> Result:
    """Seconds of the slowest variant's training on two threads, from a few of its epochs.

    With untrained surrogates, which cost the same, and the true physics of a thousand trajectories
    after every epoch.
    """
    epochs, seeds = (1, 200) if setting.quick else (5, 1800)
    runs: dict[str, Timing] = {}
    for name, variant in variants().items():
        run = timed(partial(train, setting, name, replace(variant, epochs=epochs, fitness_start=0), seeds))
        runs[f"{name}, scaled from {epochs} epochs"] = Timing(*(x * variant.epochs / epochs for x in run))
    return Result(
        max(runs.values()), 1.0, _PAPER_TRAINING, also={name: run.wall for name, run in runs.items()}
    )


def variants() -> dict[str, Variant]:
    """The SIDE-GAN variants of the paper's first experiment, with its schedule."""
    return composed("+experiment=exp1", "scale=paper").gan


def train(setting: Setting, name: str, variant: Variant, count: int) -> None:
    """Train a variant on so many random trajectories, with untrained surrogates where it needs some."""
    constraints, trajectory = setting.problem.constraints, setting.problem.trajectory
    seeds = setting.start(count)
    predictor = converter = None
    if variant.learned:
        names = len(constraints.labels)
        predictor = SuccessPredictor(constraints.arm, trajectory, names, _WIDTH, _MARGIN_STEPS)
        predictor.eval().requires_grad_(False)
    if variant.features != "none":
        excitation = excite(constraints.body, trajectory, seeds[:200])
        features = excitation.spectrum if variant.features == "spectrum" else excitation.diagonal
        converter = Converter(constraints.arm, trajectory, features.shape[1], _WIDTH, _FEATURE_STEPS)
        converter.fit_standard(features)
        converter.eval().requires_grad_(False)
    with TemporaryDirectory() as work:
        run = Run(name, 0, Path(work), evaluation=setting.size(1000))
        surrogates = Surrogates(predictor, converter)
        train_variant(variant, constraints, trajectory, seeds, run, surrogates)
