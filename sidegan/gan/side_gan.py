"""SIDE-GAN: the adversarial loop, shared by all variants."""

import math
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import pytorch_lightning as pl
import torch
from torch import Tensor, nn

from sidegan.base.arrays import Array
from sidegan.errors import ConfigError, SideganError
from sidegan.gan.generator import TrajectoryGenerator
from sidegan.gan.losses import Adversary, Batch, Loss, common_offset, missing_distance, missing_rank
from sidegan.gan.networks import DenseGenerator, FromNoise
from sidegan.gan.published import IMAGE, ConvolutionalGenerator, PublishedScaling
from sidegan.gan.reward import Energies
from sidegan.gan.scaling import CoefficientBox, Scaling
from sidegan.gan.settings import Variant
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints

_REMEDY = "; a smaller learning_rate may help"


@dataclass(frozen=True)
class Data:
    """Data that a variant learns from."""

    constraints: Constraints  # the arm in its workspace
    trajectory: Trajectory  # the family of trajectories
    seeds: Array  # coefficients [rad/s], (N, J, H, 2); from ``training.random_trajectories`` for Exact
    # trained networks of ``surrogates`` or ``published``, if the variant has features
    success_predictor: Any = None
    converter: Any = None
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

    share = 1.0  # completed share of the training; 1 outside of a training: final weights of losses
    energies: Energies | None = None  # for exact labels, set by a variant whose converter predicts them

    def __init__(self, settings: Variant, data: Data, name: str = "sidegan") -> None:
        super().__init__()
        self.automatic_optimization = False
        self.settings, self.data, self.name = settings, data, name
        self.seeds = torch.tensor(data.seeds)
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

    def losses(self) -> list[Loss]:
        """Losses of this variant in addition to ``floors``, with their current weights."""
        raise NotImplementedError(f"{type(self).__name__} has no losses")

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
    def adversaries(self) -> dict[Adversary, float]:
        """Discriminators, each with its current weight; one of weight 0 does not learn."""
        return {loss.value: loss.weight for loss in self.losses() if isinstance(loss.value, Adversary)}

    @property
    def steps(self) -> int:
        """Steps per epoch, of the discriminators if there are any."""
        return self.settings.steps or math.ceil(len(self.data.seeds) / self.settings.generator.batch)

    def forward(self, count: int) -> Batch:
        """A batch of new trajectories."""
        generator = self.generator
        images = generator.images(count)
        free = generator.scaling.coefficients(images)
        c = generator.bounded(free)
        if c is not free:  # discriminators see what would be executed
            images = generator.scaling.image(c)
        seen = c if self.settings.published is None else images  # by the converter
        before_box = c if isinstance(generator.box, nn.Identity) else free
        return Batch(c, images, before_box, lambda: self.converter(seen))

    def training_step(self, rows: Tensor, index: int) -> None:
        """The adversarial loop: a step of the discriminators on examples, then the generator's.

        ``rows`` are the numbers of these examples, (B,) int64.
        """
        optimisers = self.optimizers()
        generator, *others = optimisers if isinstance(optimisers, list) else [optimisers]
        self.share = self.share_before(self.current_epoch, index)
        learning = [adversary for adversary, weight in self.adversaries.items() if weight]
        if learning:
            with torch.no_grad():
                fake = self(len(rows))
            loss = torch.stack([adversary.own_loss(rows, fake) for adversary in learning]).sum()
            self._record("discriminator", loss)
            self._step(others[0], loss)
        with self.toggled_optimizer(generator):  # no gradients of the discriminators' weights
            for _ in range(self.settings.generator_steps):
                self._step(generator, self.generator_loss(len(rows)))
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

    def _step(self, optimiser: Any, loss: Tensor) -> None:
        """A step of an optimiser; a loss that is not finite ends the training before the step."""
        if not torch.isfinite(loss):
            self.stop(f"the loss is {float(loss.detach())}{_REMEDY}")
        optimiser.zero_grad()
        self.manual_backward(loss)
        optimiser.step()

    def stop(self, reason: str) -> None:
        """End a training that diverged.

        Raises:
            SideganError: always, with the reason.
        """
        raise SideganError(f"{self.name} diverged in epoch {self.current_epoch}: {reason}")

    def configure_optimizers(self) -> Any:
        """Adam for the generator, and for the discriminators if there are any, with their schedules."""
        others = [parameter for adversary in self.adversaries for parameter in adversary.parameters()]
        groups = [list(self.generator.parameters()), others]
        betas = self.settings.generator.betas
        fused = self.device.type != "mps"  # five times as fast, but not on Apple's devices
        # with a rate of one, which the schedules multiply by ``rate``
        adams = [torch.optim.Adam(weights, 1.0, betas, fused=fused) for weights in groups if weights]
        return adams, [torch.optim.lr_scheduler.LambdaLR(adam, self.rate) for adam in adams]

    def rate(self, step: int) -> float:
        """Learning rate of a step of the training."""
        return self.settings.generator.rate(self.share_before(*divmod(step, self.steps)))

    def share_before(self, epoch: int, index: int) -> float:
        """Completed share of the training before a step of an epoch."""
        return (epoch + index / self.steps) / self.settings.epochs

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Save the random state of the processor, which draws all noise, with the weights."""
        checkpoint["random"] = torch.get_rng_state()

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Restore the random state, so that a resumed training gives the result of an uninterrupted one."""
        torch.set_rng_state(checkpoint["random"])
