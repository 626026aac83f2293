"""SIDE-GAN: the adversarial loop, once for all variants."""

from abc import abstractmethod
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Any

import pytorch_lightning as pl
import torch
from torch import Tensor

from sidegan.base.arrays import Array
from sidegan.errors import SideganError
from sidegan.gan.generator import TrajectoryGenerator
from sidegan.gan.limits import Box
from sidegan.gan.losses import Adversary, Batch, Loss, common_offset, missing_distance, missing_rank
from sidegan.gan.networks import Generator
from sidegan.gan.reward import Energies
from sidegan.gan.scaling import Scaling
from sidegan.gan.settings import Variant
from sidegan.gan.tensors import tensor
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints


@dataclass(frozen=True)
class Data:
    """Data from which a variant learns."""

    constraints: Constraints  # the arm in its workspace
    trajectory: Trajectory  # the family of trajectories
    # Coefficients [rad/s], (N, J, H, 2); of ``training.random_trajectories`` for Exact, which needs none.
    seeds: Array
    success_predictor: Any = None  # a trained network, where the variant has features; None elsewhere
    converter: Any = None  # likewise
    box: float | None = None  # largest absolute coefficient [rad/s] that a generator may yield; None: any


class SideGAN(pl.LightningModule):
    """A generator that learns from a sum of losses, some of which are discriminators that learn too.

    A variant is a subclass of ``variants``: its ``__init__`` makes the networks that its losses need, and
    ``losses`` says which losses it adds. To add one of your own, write it in that list as a function of a
    ``Batch``, with its weight,

        Loss(weights.slow, lambda batch: batch.coefficients.square().mean())

    and set the weight: a field of ``settings.Weights``, and its value in the variant's file in ``conf/gan``.
    A new variant is a class in ``variants.VARIANTS`` with its name in ``settings.Name``, and such a file.

    Args:
        settings: of the variant.
        data: seeds, and trained surrogates for a variant that learns from them.
        name: of what is trained, for messages.
    """

    share = 1.0  # of the training that is done
    energies: Energies | None = None  # that a converter predicts, where it does

    def __init__(self, settings: Variant, data: Data, name: str = "sidegan") -> None:
        super().__init__()
        self.automatic_optimization = False
        self.settings, self.data, self.name = settings, data, name
        self.seeds = tensor(data.seeds)
        self.generator = self.make_generator()
        # Copies, since they may go on learning.
        self.success_predictor, self.converter = deepcopy((data.success_predictor, data.converter))

    def make_generator(self) -> TrajectoryGenerator:
        """The generator before its training, with the scale of the seeds."""
        settings, family, box = self.settings, self.data.trajectory, self.data.box
        joints, harmonics, _ = family.shape
        network = Generator(joints, harmonics, settings.noise, settings.width, settings.gaussian_start)
        seeds = self.seeds if box is None else Box(box).free(self.seeds)
        scaling = Scaling.fit(seeds)
        if settings.gaussian_start:
            network.start_from(scaling.image(seeds))
        last: dict[str, Any] = {"limited": settings.limited, "box": box, "corrections": settings.corrections}
        return TrajectoryGenerator(network, scaling, family, self.data.constraints.arm, **last)

    @abstractmethod
    def losses(self) -> list[Loss]:
        """Losses that the variant adds to those of every variant, with their weights at this moment."""

    @cached_property
    def floors(self) -> list[Loss]:
        """Losses of every variant: a batch is as diverse as seeds."""
        weights, seeds, share = self.settings.weights, self.data.seeds, self.settings.diversity
        return [
            Loss(weights.distance, missing_distance(seeds)),
            Loss(weights.rank, missing_rank(seeds, self.settings.batch, share)),
            Loss(weights.offset, common_offset(seeds)),
        ]

    @property
    def adversaries(self) -> list[Adversary]:
        """Discriminators whose loss counts."""
        return [loss.value for loss in self.losses() if loss.weight and isinstance(loss.value, Adversary)]

    @property
    def steps(self) -> int:
        """Steps per epoch, of the discriminators where there are any."""
        return self.settings.steps or -(-len(self.data.seeds) // self.settings.batch)

    def forward(self, count: int) -> Batch:
        """So many new trajectories, as losses see them."""
        generator = self.generator
        images = generator.images(count)
        c = generator.coefficients(images)
        free = c if generator.box is None else generator.scaling.coefficients(images)
        if generator.limits is not None or generator.box is not None:
            images = generator.scaling.image(c)
        return Batch(c, images, free, self.convert)

    def convert(self, batch: Batch) -> Tensor:
        """Features that the converter predicts, (B, p)."""
        return self.converter(batch.coefficients)

    def training_step(self, batch: list[Tensor], index: int) -> None:
        """The adversarial loop: a step of the discriminators on some examples, then the generator's."""
        rows = batch[0]
        optimisers = self.optimizers()
        generator, *critics = optimisers if isinstance(optimisers, list) else [optimisers]
        self.share = (self.current_epoch + index / self.steps) / self.settings.epochs
        for group in chain.from_iterable(one.param_groups for one in (generator, *critics)):
            group["lr"] = self.settings.rate(self.share)
        for optimiser in critics:
            self._step(optimiser, self.adversary_loss(rows))
        for _ in range(self.settings.generator_steps):
            self._step(generator, self.generator_loss(len(rows)))

    def adversary_loss(self, rows: Tensor) -> Tensor:
        """Sum of the discriminators' losses on these examples and a new batch, 0-dimensional."""
        with torch.no_grad():
            fake = self(len(rows))
        return torch.stack([adversary.own_loss(rows, fake) for adversary in self.adversaries]).sum()

    def generator_loss(self, count: int) -> Tensor:
        """Weighted sum of the losses on a new batch, 0-dimensional."""
        batch, losses = self(count), [*self.losses(), *self.floors]
        return torch.stack([weight * value(batch) for weight, value in losses if weight]).sum()

    def _step(self, adam: Any, loss: Tensor) -> None:
        """One step of an optimiser; a loss that is not a number ends the training before it does harm."""
        if not torch.isfinite(loss):
            self.stop(f"the loss is {float(loss.detach())}; the last whole epoch is kept")
        adam.zero_grad()
        self.manual_backward(loss)
        adam.step()

    def stop(self, reason: str) -> None:
        """End a training that diverged.

        Raises:
            SideganError: always, with the reason.
        """
        raise SideganError(f"{self.name} diverged in epoch {self.current_epoch}: {reason}")

    def configure_optimizers(self) -> list[torch.optim.Optimizer]:
        """Adam for the generator, and for the discriminators where there are any."""
        critics = [parameter for adversary in self.adversaries for parameter in adversary.parameters()]
        learning = [list(self.generator.parameters()), critics]
        rate, betas = self.settings.learning_rate, self.settings.betas
        fused = self.device.type != "mps"  # one pass over all weights: five times as fast
        return [torch.optim.Adam(weights, rate, betas, fused=fused) for weights in learning if weights]

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Keep the random state with the weights."""
        checkpoint["random"] = torch.get_rng_state()

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Go on with it, so that an interrupted training becomes what it would have been."""
        torch.set_rng_state(checkpoint["random"])
