"""SIDE-GAN: the adversarial loop, shared by all variants."""

from abc import abstractmethod
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import pytorch_lightning as pl
import torch
from torch import Tensor

from sidegan.base.arrays import Array
from sidegan.errors import ConfigError, SideganError
from sidegan.gan.generator import TrajectoryGenerator
from sidegan.gan.losses import Adversary, Batch, Loss, common_offset, missing_distance, missing_rank
from sidegan.gan.networks import DenseGenerator, FromNoise
from sidegan.gan.published import IMAGE, ConvolutionalGenerator, PublishedScaling
from sidegan.gan.reward import Energies
from sidegan.gan.scaling import CoefficientBox, Scaling
from sidegan.gan.settings import Variant
from sidegan.gan.tensors import tensor
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints

_REMEDY = "; a smaller learning_rate may help"


@dataclass(frozen=True)
class Data:
    """Data that a variant learns from."""

    constraints: Constraints  # the arm in its workspace
    trajectory: Trajectory  # the family of trajectories
    seeds: Array  # coefficients [rad/s], (N, J, H, 2); from ``training.random_trajectories`` for Exact
    success_predictor: Any = None  # a trained network, if the variant has features
    converter: Any = None  # a trained network, if the variant has features
    box: float | None = None  # bound on the generator's absolute coefficients [rad/s]; None: no bound


class SideGAN(pl.LightningModule):
    """A generator trained on a sum of losses, some of which are discriminators trained with it.

    A variant is a subclass in ``variants``: its ``__init__`` makes the networks for its losses, and
    ``losses`` lists them. To add a loss, add a function of a ``Batch`` with its weight to that list,

        Loss(weights.slow, lambda batch: batch.coefficients.square().mean())

    and set the weight: a field of ``settings.Weights``, and its value in the variant's file in ``conf/gan``.
    A new variant is a subclass of one in ``variants`` and such a file; both may be outside this package.

    Args:
        settings: of the variant.
        data: seeds, and trained surrogates if the variant needs them.
        name: of the variant, for messages.
    """

    share = 1.0  # completed share of the training
    energies: Energies | None = None  # set if the converter predicts energies

    def __init__(self, settings: Variant, data: Data, name: str = "sidegan") -> None:
        super().__init__()
        self.automatic_optimization = False
        self.settings, self.data, self.name = settings, data, name
        self.seeds = tensor(data.seeds)
        arm = data.constraints.arm
        self.generator = TrajectoryGenerator(
            *self.make_network(),
            data.trajectory,
            arm,
            limited=settings.generator.limited,
            box=data.box,
            corrections=settings.generator.corrections,
        )
        # Copies, since they may be trained further.
        self.success_predictor, self.converter = deepcopy((data.success_predictor, data.converter))

    def make_network(self) -> tuple[FromNoise, Scaling | PublishedScaling]:
        """The generator's untrained network, and its scaling: of the seeds, or of the published images."""
        settings, box = self.settings.generator, self.data.box
        joints, harmonics, _ = self.data.trajectory.shape
        if settings.network == "convolutional":
            published = PublishedScaling(joints, harmonics)
            if published.shape != IMAGE:
                raise ConfigError(
                    f"{self.name}: the published networks see images of shape {IMAGE}, of 7 joints and 6 "
                    f"harmonics; these trajectories have {joints} joints and {harmonics} harmonics"
                )
            return ConvolutionalGenerator(settings.noise, settings.width, settings.batch), published
        network = DenseGenerator(joints, harmonics, settings.noise, settings.width, settings.gaussian_start)
        seeds = self.seeds if box is None else CoefficientBox(box).free(self.seeds)
        scaling = Scaling.fit(seeds)
        if settings.gaussian_start:
            network.start_from(scaling.image(seeds))
        return network, scaling

    @abstractmethod
    def losses(self) -> list[Loss]:
        """Losses of this variant in addition to ``floors``, with their current weights."""

    @cached_property
    def floors(self) -> list[Loss]:
        """Losses of every variant, which keep a batch as diverse as the seeds."""
        settings, weights, seeds = self.settings, self.settings.weights, self.data.seeds
        return [
            Loss(weights.distance, missing_distance(seeds), "distance"),
            Loss(weights.rank, missing_rank(seeds, settings.generator.batch, settings.diversity), "rank"),
            Loss(weights.offset, common_offset(seeds), "offset"),
        ]

    @property
    def adversaries(self) -> list[Adversary]:
        """Discriminators of losses with a weight."""
        return [loss.value for loss in self.losses() if loss.weight and isinstance(loss.value, Adversary)]

    @property
    def steps(self) -> int:
        """Steps per epoch, of the discriminators if there are any."""
        return self.settings.steps or -(-len(self.data.seeds) // self.settings.generator.batch)

    def forward(self, count: int) -> Batch:
        """A batch of new trajectories."""
        generator = self.generator
        images = generator.images(count)
        free = generator.scaling.coefficients(images)
        c = generator.bounded(free)
        if c is not free:
            images = generator.scaling.image(c)
        seen = c if self.settings.published is None else images  # by the converter
        return Batch(c, images, c if generator.box is None else free, lambda: self.converter(seen))

    def training_step(self, batch: list[Tensor], index: int) -> None:
        """The adversarial loop: a step of the discriminators on examples, then the generator's steps."""
        rows = batch[0]
        optimisers = self.optimizers()
        generator, *critics = optimisers if isinstance(optimisers, list) else [optimisers]
        self.share = self.done(self.current_epoch, index)
        for optimiser in critics:
            with torch.no_grad():
                fake = self(len(rows))
            loss = torch.stack([d.own_loss(rows, fake) for d in self.adversaries]).sum()
            self._record("discriminator", loss)
            self._step(optimiser, loss)
        self.toggle_optimizer(generator)  # no gradients of the discriminators' weights
        for _ in range(self.settings.generator_steps):
            self._step(generator, self.generator_loss(len(rows)))
        self.untoggle_optimizer(generator)
        schedulers: Any = self.lr_schedulers()
        for scheduler in schedulers if isinstance(schedulers, list) else [schedulers]:
            scheduler.step()

    def generator_loss(self, count: int) -> Tensor:
        """Weighted sum of the losses on a new batch, 0-dimensional."""
        batch = self(count)
        if not torch.isfinite(batch.coefficients).all():
            self.stop(f"its trajectories are not finite{_REMEDY}")
        losses = [loss for loss in (*self.losses(), *self.floors) if loss.weight]
        values = torch.stack([loss.weight * loss.value(batch) for loss in losses])
        for loss, value in zip(losses, values):
            self._record(loss.name, value)
        return values.sum()

    def _record(self, name: str, value: Tensor) -> None:
        """Log a weighted loss, its mean over an epoch, if the training has a logger."""
        if self.logger is not None:
            self.log(f"loss/{name}", value.detach(), on_step=False, on_epoch=True, batch_size=1)

    def _step(self, adam: Any, loss: Tensor) -> None:
        """A step of an optimiser; a loss that is not finite ends the training before the step."""
        if not torch.isfinite(loss):
            self.stop(f"the loss is {float(loss.detach())}{_REMEDY}")
        adam.zero_grad()
        self.manual_backward(loss)
        adam.step()

    def stop(self, reason: str) -> None:
        """End a training that diverged.

        Raises:
            SideganError: always, with the reason.
        """
        raise SideganError(f"{self.name} diverged in epoch {self.current_epoch}: {reason}")

    def configure_optimizers(self) -> Any:
        """Adam for the generator, and for the discriminators if there are any, with their schedules."""
        critics = [parameter for adversary in self.adversaries for parameter in adversary.parameters()]
        groups = [list(self.generator.parameters()), critics]
        betas = self.settings.generator.betas
        fused = self.device.type != "mps"  # five times as fast where it is available
        adams = [torch.optim.Adam(weights, 1.0, betas, fused=fused) for weights in groups if weights]
        return adams, [torch.optim.lr_scheduler.LambdaLR(adam, self.rate) for adam in adams]

    def rate(self, step: int) -> float:
        """Learning rate of a step of the training."""
        return self.settings.generator.rate(self.done(*divmod(step, self.steps)))

    def done(self, epoch: int, index: int) -> float:
        """Completed share of the training before a step of an epoch."""
        return (epoch + index / self.steps) / self.settings.epochs

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Save the random state with the weights."""
        checkpoint["random"] = torch.get_rng_state()

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Restore it, so that a resumed training gives the same result as an uninterrupted one."""
        torch.set_rng_state(checkpoint["random"])
