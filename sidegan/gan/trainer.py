"""Trainings: of a module by Lightning, silent, on one device, resumable; and of a surrogate."""

import logging
import signal
import warnings
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import pytorch_lightning as pl
import torch
from torch import Tensor

from sidegan.base.parallel import Report
from sidegan.base.storage import readable
from sidegan.gan.tensors import read_tensors

_log = logging.getLogger(__name__)

_REPORTED = 20  # steps between progress reports
_LAST = "last"  # checkpoint
# Lightning's advice that does not apply: the data is small and in memory, the surrogates are frozen.
_NOISE = ".*num_workers.*|.*does not have many workers.*|.*in eval mode.*|.*LeafSpec.*|.*is not empty.*"


def fit(
    module: pl.LightningModule,
    batches: Iterable[Any],
    epochs: int,
    callbacks: Sequence[pl.Callback] = (),
    work: Path | None = None,
    device: str = "cpu",
) -> None:
    """Train a module, and move it to the CPU.

    In a work folder, training saves a checkpoint after every epoch and resumes from it; it starts over if
    there is none or it is damaged.

    Raises:
        KeyboardInterrupt: when interrupted.
    """
    logging.getLogger("pytorch_lightning").setLevel(logging.WARNING)
    kind, _, index = device.partition(":")
    known: Path | None = None
    callbacks = list(callbacks)
    if work is not None:
        checkpoint = pl.callbacks.ModelCheckpoint
        callbacks.append(checkpoint(work, _LAST, save_on_train_epoch_end=True, enable_version_counter=False))
        known = work / f"{_LAST}.ckpt"
        if not readable(known, read_tensors):
            if known.exists():
                _log.warning("the checkpoint %s is damaged: the training starts over", known)
            known = None
    handler = signal.getsignal(signal.SIGINT)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=_NOISE)
        trainer = pl.Trainer(
            max_epochs=epochs,
            accelerator={"cuda": "gpu"}.get(kind, kind),
            devices=[int(index)] if index else 1,
            callbacks=callbacks,
            enable_checkpointing=work is not None,
            logger=False,
            enable_progress_bar=False,
            enable_model_summary=False,
            default_root_dir=work,
        )
        try:
            trainer.fit(module, batches, ckpt_path=known, weights_only=True)
        except SystemExit as error:  # Lightning turns an interrupt into an exit, and ignores further ones
            signal.signal(signal.SIGINT, handler)
            raise KeyboardInterrupt from error
    module.cpu()


def learn(
    losses: Iterable[Tensor], total: int, adam: torch.optim.Optimizer, progress: Report, rates: Any = None
) -> None:
    """A step of an optimiser on each of ``total`` losses, made in turn; ``rates`` schedules its rates."""
    for done, loss in enumerate(losses, 1):
        adam.zero_grad()
        loss.backward()
        adam.step()
        if rates is not None:
            rates.step()
        if done % _REPORTED == 0 or done == total:
            progress(done, total)
