"""Training a variant with Lightning: resumable, with the true physics measured after every epoch."""

import logging
import signal
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytorch_lightning as pl
import torch
from torch import Tensor
from torch.utils.data import DataLoader, RandomSampler, TensorDataset

from sidegan.base.storage import read_torch
from sidegan.design.coordinates import Coordinates
from sidegan.design.excitation import excitation_of
from sidegan.design.problem import Problem
from sidegan.errors import ArtifactError, InfeasibleError, ShapeError, SideganError
from sidegan.gan.adversarial import AdversarialLoop
from sidegan.gan.exact import ExactFeatures, ExactPhysics
from sidegan.gan.generator import TrajectoryGenerator
from sidegan.gan.limits import Limits
from sidegan.gan.metrics import measure
from sidegan.gan.surrogates import Converter, SuccessPredictor
from sidegan.gan.variants import Variant
from sidegan.motion.dynamics import gram
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check, summarise_faults

log = logging.getLogger(__name__)

EpochEnd = Callable[[int, dict[str, float]], None]

_LAST = "last.ckpt"
_SMALL, _TRIED = 0.02, 100  # share of the limits, and number, of the motions that must not all be invalid
_RANDOM = 2000  # random trajectories that a variant without seeds starts from
# Advice of Lightning that does not apply: the data is small and in memory, the surrogates are frozen.
_NOISE = ".*num_workers.*|.*does not have many workers.*|.*in eval mode.*|.*LeafSpec.*"


@dataclass(frozen=True)
class Trained:
    """A trained generator and its metrics after every epoch."""

    generator: TrajectoryGenerator
    history: list[dict[str, float]]


def train_variant(
    variant: Variant,
    constraints: Constraints,
    trajectory: Trajectory,
    seeds: Tensor | None,
    work: Path,
    *,
    seed: int,
    evaluation: int = 200,
    predictor: SuccessPredictor | None = None,
    converter: Converter | None = None,
    device: str = "cpu",
    epoch_end: EpochEnd | None = None,
    start: TrajectoryGenerator | None = None,
) -> Trained:
    """A generator trained on a seed set.

    Args:
        variant: losses and schedule.
        constraints: the arm in its workspace, for the metrics.
        trajectory: the family of trajectories.
        seeds: coefficients [rad/s], (N, J, H, 2); None for a variant that learns from none.
        work: folder of the checkpoint from which an interrupted training goes on.
        seed: of weights, noise and batches.
        evaluation: trajectories whose true physics is measured after every epoch; 0: none.
        predictor: frozen, when the variant weighs success.
        converter: frozen, when the variant has features.
        device: where the networks run.
        epoch_end: told (epoch, metrics) after every epoch.
        start: generator to begin with, of this arm or of another one with as many joints.

    Raises:
        ShapeError: when the seeds do not fit, or the generator to begin with has another shape.
        SideganError: when the training diverges.
    """
    pl.seed_everything(seed, verbose=False)
    if not variant.seeded:
        seeds = random_trajectories(constraints, trajectory, seed)
    if seeds is None:
        raise ShapeError(f"{variant.name} learns from a seed set, got none")
    trajectory.check(seeds)
    if len(seeds) < 2:
        raise ShapeError(f"training needs at least two seeds, got {len(seeds)}")
    steps = variant.steps or -(-len(seeds) // variant.batch)
    loop = _loop(variant, constraints, trajectory, seeds, steps * variant.epochs, predictor, converter)
    if start is not None:
        _begin_with(loop, start)
    data = TensorDataset(*_tensors(loop, constraints, trajectory, seeds))
    sampler = RandomSampler(data, replacement=True, num_samples=steps * variant.batch)
    loader = DataLoader(data, variant.batch, sampler=sampler)
    watch = _Watch(constraints, trajectory, evaluation, seed, work / _LAST, epoch_end)
    trainer = lightning_trainer(variant.epochs, work, watch, device)
    last = whole_checkpoint(work / _LAST)
    fit_resumably(trainer, loop, loader, last)
    network = loop.generator.eval().cpu()
    scaling = loop.cpu().scaling
    arm = constraints.arm
    limits = loop.limits
    made = TrajectoryGenerator(network, scaling, trajectory, arm.name, arm.digest, variant.name, limits)
    return Trained(made, loop.history)


def random_trajectories(constraints: Constraints, trajectory: Trajectory, seed: int) -> Tensor:
    """Random trajectories that use all of their position and velocity limits, (N, J, H, 2) [rad/s].

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
            f"{_SMALL:.0%} of the position and velocity limits, {summarise_faults(verdict.faults())}"
        )
    return c


def _begin_with(loop: AdversarialLoop, start: TrajectoryGenerator) -> None:
    """Take over a generator's weights, and what its images mean."""
    try:
        loop.generator.load_state_dict(start.network.state_dict())
    except RuntimeError as error:
        raise ShapeError(f"the generator of {start.robot} has another shape: {error}") from error
    loop.scaling.mean.copy_(start.scaling.mean)
    loop.scaling.spread.copy_(start.scaling.spread)


def _loop(
    variant: Variant,
    constraints: Constraints,
    trajectory: Trajectory,
    seeds: Tensor,
    steps: int,
    predictor: SuccessPredictor | None,
    converter: Converter | None,
) -> AdversarialLoop:
    limits = Limits.of(constraints.arm, trajectory) if variant.limited else None
    if variant.exact is None:
        return AdversarialLoop(variant, seeds, steps, predictor, converter, None, limits)
    physics = ExactPhysics(constraints, trajectory, variant.exact)
    features = None
    if variant.features != "none":
        features = ExactFeatures(physics.problem, variant.features, seeds)
    return AdversarialLoop(variant, seeds, steps, None, features, physics, limits)


def _tensors(
    loop: AdversarialLoop, constraints: Constraints, trajectory: Trajectory, seeds: Tensor
) -> list[Tensor]:
    tensors = [loop.scaling.image(seeds.float())]
    if loop.converter is not None:
        excitation = excitation_of(constraints.body, gram(constraints.body, trajectory, seeds))
        spectrum = loop.variant.features == "spectrum"
        tensors.append(loop.converter.standardise(excitation.spectrum if spectrum else excitation.diagonal))
    return tensors


def whole_checkpoint(path: Path) -> Path | None:
    """The checkpoint to go on from; None when there is none, or it is damaged."""
    if not path.exists():
        return None
    try:
        read_torch(path)
    except ArtifactError as error:
        log.warning("%s: the training begins anew", error)
        return None
    return path


def fit_resumably(trainer: pl.Trainer, loop: AdversarialLoop, loader: DataLoader, last: Path | None) -> None:
    """Train from a checkpoint, or from the start; an interrupt comes out as KeyboardInterrupt."""
    handler = signal.getsignal(signal.SIGINT)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=_NOISE)
            trainer.fit(loop, loader, ckpt_path=last, weights_only=True)
    except SystemExit as error:  # Lightning turns an interrupt into an exit, and is deaf to further ones
        signal.signal(signal.SIGINT, handler)
        raise KeyboardInterrupt from error


def lightning_trainer(epochs: int, work: Path, watch: pl.Callback, device: str) -> pl.Trainer:
    """A trainer that is silent and leaves saving to the ``watch``."""
    logging.getLogger("pytorch_lightning").setLevel(logging.WARNING)
    kind, _, index = device.partition(":")
    return pl.Trainer(
        max_epochs=epochs,
        accelerator={"cuda": "gpu"}.get(kind, kind),
        devices=[int(index)] if index else 1,
        callbacks=[watch],
        enable_checkpointing=False,  # the watch saves: Lightning's own saves nothing without a best
        logger=False,
        enable_progress_bar=False,
        enable_model_summary=False,
        default_root_dir=work,
    )


class _Watch(pl.Callback):
    """Measures and saves after every epoch, and stops a training that diverges."""

    def __init__(
        self,
        constraints: Constraints,
        trajectory: Trajectory,
        count: int,
        seed: int,
        last: Path,
        epoch_end: EpochEnd | None,
    ) -> None:
        self.constraints, self.trajectory = constraints, trajectory
        self.count, self.seed, self.last, self.epoch_end = count, seed, last, epoch_end

    def on_train_epoch_end(self, trainer: pl.Trainer, pl_module: pl.LightningModule) -> None:
        loop = pl_module
        if not isinstance(loop, AdversarialLoop):
            raise TypeError(f"expected an AdversarialLoop, got {type(loop).__name__}")
        noise = torch.Generator().manual_seed(self.seed * 1_000_003 + trainer.current_epoch)
        c = loop.sample(max(2, self.count), noise)
        if not torch.isfinite(c).all():
            raise SideganError(f"{loop.variant.name} diverged in epoch {trainer.current_epoch}: not a number")
        metrics = measure(self.constraints, self.trajectory, c) if self.count else {}
        loop.history.append(metrics)
        trainer.save_checkpoint(self.last)
        if self.epoch_end is not None:
            self.epoch_end(trainer.current_epoch, metrics)
