"""The one adversarial loop with a loss and measurements of another room's: what conditions train with."""

import time
from collections.abc import Callable
from pathlib import Path

import pytorch_lightning as pl
import torch
from torch import Tensor
from torch.utils.data import DataLoader, TensorDataset

from sidegan.errors import SideganError
from sidegan.gan import training
from sidegan.gan.adversarial import AdversarialLoop
from sidegan.gan.exact import ExactPhysics
from sidegan.gan.limits import Limits
from sidegan.gan.variants import Variant

Loss = Callable[["LoneLoop", int, float], Tensor]
Measure = Callable[["LoneLoop", int], dict[str, float]]

LAST = "last.ckpt"


class LoneLoop(AdversarialLoop):
    """Trains a generator that no discriminator follows on a loss that is given.

    Args:
        variant: schedule, network, and losses of diversity.
        start: random trajectories [rad/s], (N, J, H, 2), that the generator starts as diverse as.
        steps: of the whole training.
        physics: exact physics.
        limits: last layer of the variant.
        loss: of this loop, a batch's size, and the share of the training that is done.
    """

    def __init__(
        self,
        variant: Variant,
        start: Tensor,
        steps: int,
        physics: ExactPhysics,
        limits: Limits,
        loss: Loss,
    ) -> None:
        super().__init__(variant, start, steps, physics=physics, limits=limits)
        self.loss_of = loss

    def _generator_loss(self, count: int) -> Tensor:
        schedules = self.lr_schedulers()
        schedule = schedules[0] if isinstance(schedules, list) else schedules
        done = schedule.last_epoch / self.steps  # type: ignore[union-attr]
        return self.loss_of(self, count, min(1.0, done))


def fit(loop: LoneLoop, work: Path, measure: Measure, epoch_end: training.EpochEnd | None = None) -> None:
    """Train a loop, from the checkpoint in ``work`` when there is one.

    Args:
        loop: what is trained.
        work: folder of the checkpoint.
        measure: metrics after an epoch.
        epoch_end: told (epoch, metrics) after every epoch.

    Raises:
        SideganError: when the training diverges; the last whole epoch is kept.
    """
    epochs, batch = loop.variant.epochs, loop.variant.batch
    blank = TensorDataset(torch.zeros(loop.steps // epochs * batch, 1))
    watch = _Watch(work / LAST, measure, epoch_end)
    trainer = training.lightning_trainer(epochs, work, watch, "cpu")
    training.fit_resumably(trainer, loop, DataLoader(blank, batch), training.whole_checkpoint(work / LAST))


class _Watch(pl.Callback):
    """Measures and saves after every epoch, and stops a training that diverges."""

    def __init__(self, last: Path, measure: Measure, epoch_end: training.EpochEnd | None) -> None:
        self.last, self.measure, self.epoch_end = last, measure, epoch_end
        self.began = time.monotonic()

    def on_train_epoch_end(self, trainer: pl.Trainer, pl_module: pl.LightningModule) -> None:
        loop = pl_module
        if not isinstance(loop, LoneLoop):
            raise TypeError(f"expected a LoneLoop, got {type(loop).__name__}")
        if not all(bool(torch.isfinite(x).all()) for x in loop.generator.parameters()):
            raise SideganError(f"{loop.variant.name} diverged in epoch {trainer.current_epoch}: not a number")
        metrics = self.measure(loop, trainer.current_epoch)
        now = time.monotonic()
        metrics["seconds"], self.began = now - self.began, now
        loop.history.append(metrics)
        trainer.save_checkpoint(self.last)
        if self.epoch_end is not None:
            self.epoch_end(trainer.current_epoch, metrics)
