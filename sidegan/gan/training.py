"""Training of a SIDE-GAN variant: its networks and loss terms, and the true physics after every epoch."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar, cast

import pytorch_lightning as pl
import torch
from torch import Tensor, nn
from torch.utils.data import DataLoader, RandomSampler, TensorDataset

from sidegan.base.storage import read_torch, write_torch
from sidegan.design.coordinates import Coordinates
from sidegan.design.excitation import excitation_of
from sidegan.design.problem import Problem
from sidegan.errors import ConfigError, InfeasibleError, ShapeError
from sidegan.gan.diversity import distance, distance_target, rank, rank_target
from sidegan.gan.exact import objective, violation
from sidegan.gan.generator import TrajectoryGenerator
from sidegan.gan.limits import LimitLayer
from sidegan.gan.loop import EpochEnd, Training, fit
from sidegan.gan.metrics import kept_epoch, measure
from sidegan.gan.networks import Discriminator, Generator
from sidegan.gan.published import (
    IMAGE,
    ConvolutionalGenerator,
    PublishedSampler,
    ShallowNetwork,
    published_terms,
)
from sidegan.gan.scaling import Scaling
from sidegan.gan.surrogates import Converter, SuccessPredictor, Surrogates
from sidegan.gan.terms import Adversary, Batch, LossTerm, PredictedSuccess, Sampler, predicted_ratio
from sidegan.gan.variants import Variant
from sidegan.motion.dynamics import gram
from sidegan.motion.trajectory import Trajectory
from sidegan.seeds.published import Layout
from sidegan.validity import Constraints, check, summarise_faults

_SMALL, _TRIED = 0.02, 100  # share of the limits, and number, of the motions that must not all be invalid
_EPOCH = "epoch-{}.pt"  # the weights that the training would keep after it
_SAMPLES = "samples-{}.pt"  # the images that were drawn after it
_RANDOM = 2000  # random trajectories that a variant without seeds starts from
_NO_SURROGATES = Surrogates()
_P = TypeVar("_P", bound=nn.Module)
_C = TypeVar("_C", bound=nn.Module)


@dataclass(frozen=True)
class Trained:
    """A trained generator and its metrics after every epoch."""

    generator: TrajectoryGenerator
    history: list[dict[str, float]]
    epoch: int  # index in the history of the one whose generator this is
    samples: Tensor | None = None  # images drawn after every epoch, (E · n, 2, …); None where none were


@dataclass(frozen=True)
class Run:
    """How one training is run."""

    name: str  # of the variant, for files and messages
    seed: int  # of weights, noise and batches
    work: Path  # folder of the checkpoint from which an interrupted training goes on
    evaluation: int = 200  # trajectories whose true physics is measured after every epoch; 0: none
    samples: int = 0  # trajectories drawn after every epoch, for surrogates to learn from
    device: str = "cpu"  # where the networks run
    epoch_end: EpochEnd | None = None  # called with (epoch, metrics) after every epoch


def train_variant(
    variant: Variant,
    constraints: Constraints,
    trajectory: Trajectory,
    seeds: Tensor | None,
    run: Run,
    surrogates: Surrogates = _NO_SURROGATES,
) -> Trained:
    """A generator trained on a seed set (N, J, H, 2) [rad/s]; None for a variant that learns from none.

    Raises:
        ConfigError: when the variant needs a surrogate that is not given.
        ShapeError: when the seeds do not fit.
        SideganError: when the training diverges.
    """
    pl.seed_everything(run.seed, verbose=False)
    if not variant.seeded:
        seeds = random_trajectories(constraints, trajectory, run.seed)
    if seeds is None:
        raise ShapeError(f"{run.name} learns from a seed set, got none")
    trajectory.check(seeds)
    if len(seeds) < 2:
        raise ShapeError(f"training needs at least two seeds, got {len(seeds)}")
    training = assemble(variant, constraints, trajectory, seeds, run, surrogates)
    schedule, sampler = training.schedule, training.sampler
    examples = TensorDataset(torch.arange(len(seeds)))
    order = RandomSampler(examples, num_samples=schedule.steps * schedule.batch)  # whole passes first

    def evaluate(epoch: int) -> dict[str, float]:
        noise = torch.Generator().manual_seed(run.seed * 1_000_003 + epoch)
        c = training.sampled(max(2, run.evaluation), noise).cpu()
        if not torch.isfinite(c).all():
            training.stop("not a number")
        write_torch(run.work / _EPOCH.format(epoch), sampler.network.state_dict())
        if run.samples:
            with torch.no_grad():
                drawn = sampler.network.sample(run.samples, noise).cpu()
            write_torch(run.work / _SAMPLES.format(epoch), drawn)
        return measure(constraints, trajectory, c) if run.evaluation else {}

    loader = DataLoader(examples, schedule.batch, sampler=order)
    fit(training, loader, run.work, evaluate, run.epoch_end, run.device)
    kept = kept_epoch(training.history, variant.least_valid)
    network, names = sampler.network, (constraints.arm.name, constraints.arm.digest, run.name)
    network.load_state_dict(read_torch(run.work / _EPOCH.format(kept)))
    generator = TrajectoryGenerator(network.eval(), sampler.scaling, trajectory, *names, sampler.limits)
    samples = None
    if run.samples:
        samples = torch.cat([read_torch(run.work / _SAMPLES.format(i)) for i in range(variant.epochs)])
    return Trained(generator, training.history, kept, samples)


def assemble(
    variant: Variant,
    constraints: Constraints,
    trajectory: Trajectory,
    seeds: Tensor,
    run: Run,
    surrogates: Surrogates = _NO_SURROGATES,
) -> Training:
    """Networks and loss terms of a variant, untrained; as ``train_variant``, which trains them."""
    if variant.published is not None:
        return _assemble_published(variant, trajectory, seeds, run, surrogates)
    limits = LimitLayer.of(constraints.arm, trajectory) if variant.limited else None
    predictor, converter = _needed(variant, run, surrogates, SuccessPredictor, Converter)
    sampler = Sampler(*_network(variant, seeds), limits, converter)
    terms: list[LossTerm] = []
    if variant.exact is not None:
        problem = Problem(constraints, trajectory, variant.exact.samples)
        terms.append(violation(variant.weights.success, variant.exact, problem))
        terms.append(objective(variant.weights.fitness, variant.exact, problem))
    else:
        images = sampler.scaling.image(seeds.float())
        terms.append(_adversary(variant, variant.weights.adversarial, images, lambda batch: batch.images))
        if predictor is not None:
            terms.append(PredictedSuccess(variant.weights.success, predictor))
        if converter is not None:
            excitation = excitation_of(constraints.body, gram(constraints.body, trajectory, seeds))
            features = converter.standardise(getattr(excitation, variant.features))
            terms.append(
                _adversary(variant, variant.weights.features, features, lambda batch: batch.features)
            )
            terms.append(predicted_ratio(variant.weights.fitness, converter, variant.fitness_start))
    terms.append(distance(variant.weights.distance, distance_target(seeds)))
    terms.append(rank(variant.weights.rank, rank_target(seeds, variant.batch)))
    return Training(run.name, sampler, terms, variant.schedule(len(seeds)))


def _needed(
    variant: Variant, run: Run, surrogates: Surrogates, predictor: type[_P], converter: type[_C]
) -> tuple[_P | None, _C | None]:
    """The surrogates that a variant learns from, of its recipe's kinds; None where it needs none."""
    success = surrogates.predictor if variant.seeded and variant.weights.success > 0 else None
    features = surrogates.converter if variant.features != "none" else None
    if variant.seeded and variant.weights.success > 0 and not isinstance(success, predictor):
        raise ConfigError(f"{run.name} needs a predictor of success")
    if variant.features != "none" and not isinstance(features, converter):
        raise ConfigError(f"{run.name} needs a converter to {variant.features}")
    return cast("_P | None", success), cast("_C | None", features)


def _assemble_published(
    variant: Variant, trajectory: Trajectory, seeds: Tensor, run: Run, surrogates: Surrogates
) -> Training:
    """The same for a variant of the published recipe."""
    layout = Layout(trajectory.joints, trajectory.harmonics)
    if layout.shape != IMAGE:
        raise ConfigError(
            f"{run.name}: the published networks see images of shape {IMAGE}, of 7 joints and 6 harmonics; "
            f"these trajectories have {trajectory.joints} joints and {trajectory.harmonics} harmonics"
        )
    network = ConvolutionalGenerator(variant.noise, variant.width, variant.batch)
    predictor, converter = _needed(variant, run, surrogates, ShallowNetwork, ShallowNetwork)
    sampler = PublishedSampler(network, layout, converter)
    terms = published_terms(variant, sampler, seeds, predictor)
    return Training(run.name, sampler, terms, variant.schedule(len(seeds)))


def _network(variant: Variant, seeds: Tensor) -> tuple[Generator, Scaling]:
    """The generator's network and what its images mean."""
    _, joints, harmonics, _ = seeds.shape
    network = Generator(joints, harmonics, variant.noise, variant.width, variant.gaussian_start)
    scaling = Scaling.fit(seeds)
    if variant.gaussian_start:
        network.start_from(scaling.image(seeds.double()))
    return network, scaling


def _adversary(
    variant: Variant, weight: float, examples: Tensor, view: Callable[[Batch], Tensor]
) -> Adversary:
    """A discriminator of what it sees of trajectories, and of as much of the seeds (N, …)."""
    return Adversary(weight, Discriminator(examples[0].numel(), variant.width), examples, view)


def random_trajectories(constraints: Constraints, trajectory: Trajectory, seed: int) -> Tensor:
    """Random trajectories that use all of their limits on motion, (N, J, H, 2) [rad/s].

    What a variant without seeds starts from, and whose diversity it keeps: they follow from the arm alone.

    Raises:
        InfeasibleError: when not even small motions are valid; says what they violate.
    """
    problem = Problem(constraints, trajectory)
    coordinates = Coordinates.of(problem)
    noise = torch.Generator().manual_seed(seed)
    c = coordinates.coefficients(coordinates.start(problem, _RANDOM, noise, 1.0))
    verdict = check(constraints, trajectory, _SMALL * c[:_TRIED])
    if not verdict.valid.any():
        raise InfeasibleError(
            f"the arm cannot even move a little around home: of {_TRIED} random motions that use "
            f"{_SMALL:.0%} of their limits on motion, {summarise_faults(verdict.faults())}"
        )
    return c
