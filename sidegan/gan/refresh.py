"""Surrogates that keep learning during a GAN's training, from the generator's current samples."""

from itertools import chain
from typing import Any

import numpy as np
import pytorch_lightning as pl
import torch

from sidegan.gan.labels import Labelled, label
from sidegan.gan.settings import Refresh
from sidegan.gan.side_gan import SideGAN
from sidegan.gan.tensors import tensor

_BATCH = 100


class Refreshed(pl.Callback):
    """Train the surrogates further before every epoch, on exact labels of recent samples.

    A generator learns to exploit the errors of frozen surrogates; here they learn from these samples. The
    state is part of checkpoints, so that a resumed training gives the same result.
    """

    def __init__(self, settings: Refresh, seed: int) -> None:
        self.settings = settings
        self.random = torch.Generator().manual_seed(-1 - seed)  # independent of weights and batches
        self.window: list[Labelled] = []  # samples of the last epochs
        self.saved: dict[str, Any] | None = None  # state of the optimiser in a checkpoint

    def on_train_start(self, trainer: pl.Trainer, pl_module: SideGAN) -> None:  # type: ignore[override]
        """Create or restore the optimiser, now that the surrogates are on their device."""
        self.surrogates = (pl_module.success_predictor, pl_module.converter)
        weights = chain(*(surrogate.parameters() for surrogate in self.surrogates))
        self.adam = torch.optim.Adam(weights, self.settings.learning_rate)
        if self.saved is not None:
            self.adam.load_state_dict(self.saved)

    def on_train_epoch_start(self, trainer: pl.Trainer, pl_module: SideGAN) -> None:  # type: ignore[override]
        """Label new samples, and train on those of the last epochs."""
        data = pl_module.data
        settings = self.settings
        predictor, converter = self.surrogates
        new = pl_module.generator.sample(settings.samples, self.random)
        steps = predictor.roll_out.steps
        made = label(data.constraints, data.trajectory, new, steps, lambda *_: None, pl_module.energies)
        self.window = [*self.window, made][-settings.window :]
        recent = Labelled.join(self.window)
        features = getattr(recent, str(pl_module.settings.features)).astype(np.float32)
        labels = [tensor(x).to(pl_module.device) for x in (recent.c, recent.margins, recent.valid, features)]
        for network in self.surrogates:
            network.requires_grad_(True)
        for _ in range(settings.steps):
            rows = torch.randint(len(recent.c), (_BATCH,), generator=self.random)
            c, margins, valid, target = (x[rows] for x in labels)
            loss = predictor.training_step([c, margins, valid], 0)
            loss = loss + converter.training_step([c, converter.standardise(target)], 0)
            self.adam.zero_grad()
            loss.backward()
            self.adam.step()
        for network in self.surrogates:
            network.freeze()

    def state_dict(self) -> dict[str, Any]:
        """State for a checkpoint."""
        window = [tuple(map(tensor, batch)) for batch in self.window]
        return {"adam": self.adam.state_dict(), "window": window, "random": self.random.get_state()}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Restore the state of a checkpoint."""
        self.saved = state_dict["adam"]
        self.window = [Labelled(*(x.cpu().numpy() for x in batch)) for batch in state_dict["window"]]
        self.random.set_state(state_dict["random"].cpu())
