"""The one training loop: a generator against a sum of loss terms, some of which learn themselves."""

import logging
import signal
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytorch_lightning as pl
import torch
from torch import Tensor, nn
from torch.utils.data import DataLoader

from sidegan.base.storage import read_torch
from sidegan.errors import ArtifactError, SideganError
from sidegan.gan.published import PublishedSampler
from sidegan.gan.schedule import Schedule
from sidegan.gan.terms import Adversary, LossTerm, Sampler

log = logging.getLogger(__name__)

Evaluate = Callable[[int], dict[str, float]]
EpochEnd = Callable[[int, dict[str, float]], None]

_LAST = "last.ckpt"
_RANDOM = "random"  # state of torch's random numbers, in a checkpoint
# Advice of Lightning that does not apply: the data is small and in memory, the surrogates are frozen.
_NOISE = ".*num_workers.*|.*does not have many workers.*|.*in eval mode.*|.*LeafSpec.*"


class Training(pl.LightningModule):
    """Trains a sampler's network on the weighted sum of loss terms.

    Args:
        name: what is trained, for messages.
        sampler: makes a batch of so many trajectories; its ``network`` is what learns.
        terms: of the loss, summed in this order.
        schedule: how long and how fast.
    """

    def __init__(
        self, name: str, sampler: Sampler | PublishedSampler, terms: Sequence[LossTerm], schedule: Schedule
    ) -> None:
        super().__init__()
        self.automatic_optimization = False
        self.name, self.sampler, self.schedule = name, sampler, schedule
        self.parts, self.terms = list(terms), nn.ModuleList(terms)
        self.adversaries = [term for term in terms if isinstance(term, Adversary)]
        self.steps_done = 0
        self.history: list[dict[str, float]] = []

    def training_step(self, batch: list[Tensor], _: int) -> None:
        """One step of the discriminators on some of their examples, then the generator's."""
        rows = batch[0]
        generator, *critics = _several(self.optimizers())
        for optimiser in critics:
            self._step(optimiser, self.adversary_loss(rows))
        for _ in range(self.schedule.generator_steps):
            self._step(generator, self.generator_loss(len(rows)))
        self.steps_done += 1

    @torch.no_grad()
    def sampled(self, count: int, random: torch.Generator) -> Tensor:
        """Trajectories (count, J, H, 2) [rad/s] float64 of the network at hand."""
        return self.sampler(count, random).coefficients.double()

    def adversary_loss(self, rows: Tensor) -> Tensor:
        """Sum of the discriminators' losses on these examples and a new batch, 0-dimensional."""
        with torch.no_grad():
            fake = self.sampler(len(rows))
        return torch.stack([adversary.update_loss(rows, fake) for adversary in self.adversaries]).sum()

    def generator_loss(self, count: int) -> Tensor:
        """Weighted sum of the terms on a new batch, 0-dimensional."""
        batch, eased = self.sampler(count), self.schedule.eased(self.steps_done)
        weighted = [(term.weight_at(self.current_epoch, eased), term) for term in self.parts]
        return torch.stack([weight * term(batch) for weight, term in weighted if weight]).sum()

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
        critics = [parameter for term in self.adversaries for parameter in term.network.parameters()]
        learning = [list(self.sampler.network.parameters()), critics]
        rate, betas = self.schedule.learning_rate, self.schedule.betas
        fused = self.device.type != "mps"  # one pass over all weights: five times as fast
        return [torch.optim.Adam(weights, rate, betas, fused=fused) for weights in learning if weights]

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Keep the progress, the history of metrics and the random state with the weights."""
        checkpoint["progress"] = {"steps_done": self.steps_done, "history": self.history}
        checkpoint[_RANDOM] = torch.get_rng_state()

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Go on with them, so that what was interrupted becomes what it would have been."""
        self.steps_done, self.history = (checkpoint["progress"][key] for key in ("steps_done", "history"))
        torch.set_rng_state(checkpoint[_RANDOM])


class _Watch(pl.Callback):
    """Measures and saves after every epoch."""

    def __init__(self, last: Path, evaluate: Evaluate, epoch_end: EpochEnd | None) -> None:
        self.last, self.evaluate, self.epoch_end = last, evaluate, epoch_end

    def on_train_epoch_end(self, trainer: pl.Trainer, pl_module: pl.LightningModule) -> None:
        metrics = self.evaluate(trainer.current_epoch)
        pl_module.history.append(metrics)  # type: ignore[operator, union-attr]
        trainer.save_checkpoint(self.last)
        if self.epoch_end is not None:
            self.epoch_end(trainer.current_epoch, metrics)


def fit(
    training: Training,
    rows: DataLoader,
    work: Path,
    evaluate: Evaluate,
    epoch_end: EpochEnd | None = None,
    device: str = "cpu",
) -> None:
    """Train from the checkpoint in ``work``, or from the start when there is none or it is damaged.

    The rows are indices of examples, a batch for each step. After every epoch ``evaluate`` gives its metrics,
    and ``epoch_end`` is called with both. What is trained ends on the CPU.

    Raises:
        SideganError: when the training diverges; the last whole epoch is kept.
        KeyboardInterrupt: when it is interrupted.
    """
    last = work / _LAST
    trainer = _trainer(training.schedule.epochs, work, _Watch(last, evaluate, epoch_end), device)
    handler = signal.getsignal(signal.SIGINT)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=_NOISE)
            trainer.fit(training, rows, ckpt_path=_whole(last), weights_only=True)
    except SystemExit as error:  # Lightning turns an interrupt into an exit, and is deaf to further ones
        signal.signal(signal.SIGINT, handler)
        raise KeyboardInterrupt from error
    training.cpu()


def _trainer(epochs: int, work: Path, watch: pl.Callback, device: str) -> pl.Trainer:
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


def _whole(path: Path) -> Path | None:
    """The checkpoint to go on from; None when there is none, or it is damaged or of an earlier version."""
    if not path.exists():
        return None
    try:
        return path if _RANDOM in read_torch(path) else None
    except ArtifactError as error:
        log.warning("%s: the training begins anew", error)
        return None


def _several(x: Any) -> list[Any]:
    """Lightning gives one optimiser as itself, several as a list."""
    return list(x) if isinstance(x, (list, tuple)) else [x]
