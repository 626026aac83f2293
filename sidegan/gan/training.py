"""Train a variant by Lightning, and measure its samples with exact physics after every epoch."""

import logging
import math
import signal
import warnings
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import numpy as np
import pytorch_lightning as pl
import torch
from lightning_fabric.utilities.exceptions import MisconfigurationException
from pytorch_lightning.callbacks import ModelCheckpoint
from pytorch_lightning.loggers import Logger
from torch import nn
from torch.utils.data import DataLoader, RandomSampler

from sidegan.base.arrays import Array
from sidegan.base.parallel import Report
from sidegan.base.storage import readable
from sidegan.design.prediction import random_motions
from sidegan.design.problem import Problem
from sidegan.errors import ConfigError, InfeasibleError
from sidegan.gan.generator import TrajectoryGenerator
from sidegan.gan.metrics import measure_samples
from sidegan.gan.pretraining import Labelled, label
from sidegan.gan.scaling import CoefficientBox
from sidegan.gan.settings import Refresh, TrainerSettings, Variant
from sidegan.gan.side_gan import Data, SideGAN
from sidegan.gan.surrogates import learn
from sidegan.gan.tensors import keep_freed_memory, numpy_array, read_tensors
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check, summarise_faults

_log = logging.getLogger(__name__)

# Advice that does not apply: the data is small and in memory, surrogates are frozen, discriminators may wait.
_NOISE = ".*num_workers.*|.*does not have many workers.*|.*in eval mode.*|.*LeafSpec.*|.*is not empty.*"
_NOISE += "|.*lr_scheduler.step.*"
_REFRESHED = 100  # samples per batch of the surrogates' further training
_SMALL, _TRIED = 0.02, 100  # share of the limits, and number, of small motions of which some must be valid
# Number of random trajectories that replace seeds, and the share of their limits that they use, which leaves
# room to grow; with a box they use all of them, since the box reduces them.
_RANDOM, _REACH = 2000, 0.6


@dataclass(frozen=True)
class Trained:
    """A trained generator and its metrics after every epoch."""

    generator: TrajectoryGenerator  # of the last epoch
    history: list[dict[str, float]]
    samples: Array  # images drawn after every epoch, (E · n, 2, …) float32; empty unless requested


@dataclass(frozen=True)
class TrainingRun:
    """Options of a training run."""

    name: str  # of the variant, for files and messages
    seed: int  # of weights, noise and batches
    work: Path  # folder of checkpoints to resume from
    evaluation: int = 200  # trajectories to evaluate with exact physics after every epoch
    samples: int = 0  # trajectories to keep of every epoch, for surrogates to learn from
    trainer: TrainerSettings = TrainerSettings()
    progress: Report = lambda done, total: None  # in epochs
    logger: Logger | None = None  # of losses and metrics, while it runs


def train_variant(settings: Variant, data: Data, run: TrainingRun) -> Trained:
    """Train a generator, or resume its interrupted training.

    Raises:
        ConfigError: when a surrogate is missing, or all seeds are the same.
        ShapeError: when the seeds do not fit.
        SideganError: when the training diverges.
        KeyboardInterrupt: when interrupted.
    """
    keep_freed_memory()
    torch.manual_seed(run.seed)
    data.trajectory.check(data.seeds)
    if len(data.seeds) > 1 and not np.ptp(data.seeds, axis=0).any():
        raise ConfigError(f"all {len(data.seeds)} seeds are the same trajectory, expected different ones")
    model = resolve_name(settings._target_)(settings, data, run.name)
    rows, batch = range(len(data.seeds)), settings.generator.batch
    order = RandomSampler(rows, num_samples=model.steps * batch)  # without replacement in each pass
    batches: DataLoader[Any] = DataLoader(rows, batch, sampler=order)  # type: ignore[arg-type]  # any sequence
    refresh = [] if settings.refresh is None else [Refreshed(settings.refresh, run.seed)]
    metrics = EpochMetrics(run)
    _fit(model, batches, [*refresh, metrics], run)
    return Trained(model.generator.eval(), metrics.history, torch.cat(metrics.samples).numpy())


def _fit(model: SideGAN, batches: DataLoader[Any], callbacks: list[pl.Callback], run: TrainingRun) -> None:
    """Train a model, and move it to the processor.

    A checkpoint is saved in the work folder after every epoch. Training resumes from it; it starts over if
    there is none or it is damaged.
    """
    logging.getLogger("pytorch_lightning").setLevel(logging.WARNING)
    saved = run.work / "last.ckpt"
    sound = readable(saved, read_tensors)
    if saved.exists() and not sound:
        _log.warning("the checkpoint %s is damaged: the training starts over", saved)
    saving = ModelCheckpoint(run.work, saved.stem, save_on_train_epoch_end=True, enable_version_counter=False)
    handler = signal.getsignal(signal.SIGINT)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=_NOISE)
        trainer = pl.Trainer(
            max_epochs=model.settings.epochs,
            accelerator=run.trainer.accelerator,
            devices=run.trainer.devices,
            callbacks=[*callbacks, saving],
            logger=run.logger or False,
            log_every_n_steps=1,
            enable_progress_bar=False,
            enable_model_summary=False,
            default_root_dir=run.work,
        )
        try:
            trainer.fit(model, batches, ckpt_path=saved if sound else None, weights_only=True)
        except SystemExit as error:  # Lightning turns an interrupt into an exit, and ignores further ones
            signal.signal(signal.SIGINT, handler)
            raise KeyboardInterrupt from error
    model.cpu()


def unavailable(where: TrainerSettings) -> str:
    """Lightning's message for an unavailable device; empty for an available one."""
    try:
        pl.Trainer(accelerator=where.accelerator, devices=where.devices, logger=False)
    except (MisconfigurationException, TypeError) as error:
        return str(error).splitlines()[0]
    return ""


class Refreshed(pl.Callback):
    """Train the surrogates further before every epoch, on exact labels of recent samples.

    A generator learns to exploit the errors of frozen surrogates; here they learn from these samples. The
    state is part of checkpoints, so that a resumed training gives the same result.
    """

    def __init__(self, settings: Refresh, seed: int) -> None:
        self.settings = settings
        self.random = torch.Generator().manual_seed(-1 - seed)  # independent of weights and batches
        self.window = deque[Labelled](maxlen=settings.window)  # samples of the last epochs
        self.saved: dict[str, Any] | None = None  # state of the optimiser in a checkpoint

    def on_train_start(self, trainer: pl.Trainer, pl_module: SideGAN) -> None:  # type: ignore[override]
        """Create or restore the optimiser, now that the surrogates are on their device."""
        self.surrogates = nn.ModuleList([pl_module.success_predictor, pl_module.converter])
        self.adam = torch.optim.Adam(self.surrogates.parameters(), self.settings.learning_rate)
        if self.saved is not None:
            self.adam.load_state_dict(self.saved)

    def on_train_epoch_start(self, trainer: pl.Trainer, pl_module: SideGAN) -> None:  # type: ignore[override]
        """Label new samples, and train on those of the last epochs."""
        data, settings = pl_module.data, self.settings
        predictor, converter = pl_module.success_predictor, pl_module.converter
        new = pl_module.generator.sample(settings.samples, self.random)
        steps = predictor.roll_out.steps
        made = label(data.constraints, data.trajectory, new, steps, lambda *_: None, pl_module.energies)
        self.window.append(made)
        recent = Labelled.join(self.window)
        features = getattr(recent, str(pl_module.settings.features)).astype(np.float32)
        labels = (recent.c, recent.margins, recent.valid, features)
        c, margins, valid, target = (torch.tensor(x).to(pl_module.device) for x in labels)
        self.surrogates.requires_grad_(True)
        target, count = converter.standardise(target), settings.steps
        batches = (torch.randint(len(c), (_REFRESHED,), generator=self.random) for _ in range(count))
        losses = (
            predictor.loss(c[rows], margins[rows], valid[rows]) + converter.loss(c[rows], target[rows])
            for rows in batches
        )
        learn(losses, count, self.adam, lambda *_: None)
        self.surrogates.requires_grad_(False)

    def state_dict(self) -> dict[str, Any]:
        """State for a checkpoint."""
        window = [tuple(map(torch.tensor, batch)) for batch in self.window]
        return {"adam": self.adam.state_dict(), "window": window, "random": self.random.get_state()}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Restore the state of a checkpoint."""
        self.saved = state_dict["adam"]
        self.window.extend(Labelled(*(x.cpu().numpy() for x in batch)) for batch in state_dict["window"])
        self.random.set_state(state_dict["random"].cpu())


class EpochMetrics(pl.Callback):
    """Measure a generator's samples with exact physics after every epoch.

    The metrics so far are part of checkpoints.
    """

    def __init__(self, run: TrainingRun) -> None:
        self.run = run
        self.history: list[dict[str, float]] = []  # a row per epoch
        self.samples: list[torch.Tensor] = []  # images of each epoch, (n, 2, …)

    @torch.no_grad()
    def on_train_epoch_end(self, trainer: pl.Trainer, pl_module: SideGAN) -> None:  # type: ignore[override]
        """Measure before Lightning saves its checkpoint."""
        run, epoch, generator = self.run, trainer.current_epoch, pl_module.generator
        noise = torch.Generator().manual_seed(run.seed * 1_000_003 + epoch)
        c = generator.sample(run.evaluation, noise)
        if not np.isfinite(c).all():
            pl_module.stop("its trajectories are not finite")
        data = pl_module.data
        seeds = data.seeds if pl_module.settings.seeded else None
        metrics = measure_samples(data.constraints, data.trajectory, c, seeds)
        self.history.append(metrics)
        self.samples.append(generator.images(run.samples, noise).cpu() if run.samples else torch.empty(0))
        if run.logger is not None:
            known = {name: x for name, x in metrics.items() if math.isfinite(x)}
            pl_module.log_dict({**known, "step": float(epoch)})  # Lightning's name of the axis
        run.progress(epoch + 1, trainer.max_epochs or 0)

    def state_dict(self) -> dict[str, Any]:
        """State for a checkpoint."""
        return {"history": self.history, "samples": self.samples}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Restore the state of a checkpoint."""
        self.history, self.samples = state_dict["history"], state_dict["samples"]


def random_trajectories(
    constraints: Constraints, trajectory: Trajectory, seed: int, box: float | None = None
) -> Array:
    """Random trajectories [rad/s], (N, J, H, 2), in a box, that use much of the limits on motion.

    They replace seeds as the start of a variant without them, and as its target of diversity.

    Raises:
        InfeasibleError: when not even small motions are valid; names the violated constraints.
    """
    reach = _REACH if box is None else 1.0
    c = random_motions(Problem(constraints, trajectory), _RANDOM, reach, seed)
    verdict = check(constraints, trajectory, _SMALL / reach * c[:_TRIED])
    if not verdict.valid.any():
        raise InfeasibleError(
            f"the arm cannot even move a little around home: of {_TRIED} random motions that use "
            f"{_SMALL:.0%} of their limits on motion, {summarise_faults(verdict.faults())}"
        )
    return c if box is None else numpy_array(CoefficientBox(box)(torch.tensor(c)))
