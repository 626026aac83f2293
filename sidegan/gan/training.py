"""Training of a variant, with the true physics of what it generates after every epoch."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytorch_lightning as pl
import torch
from torch.utils.data import DataLoader, RandomSampler, TensorDataset

from sidegan.base.arrays import Array
from sidegan.base.parallel import Report
from sidegan.design.coordinates import Coordinates
from sidegan.design.problem import Problem
from sidegan.errors import InfeasibleError
from sidegan.gan.generator import TrajectoryGenerator
from sidegan.gan.limits import Box
from sidegan.gan.metrics import measure
from sidegan.gan.refresh import Refreshed
from sidegan.gan.settings import Variant
from sidegan.gan.side_gan import Data, SideGAN
from sidegan.gan.tensors import array, read_tensors, tensor, write_tensors
from sidegan.gan.trainer import fit
from sidegan.gan.variants import VARIANTS
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check, summarise_faults

_SMALL, _TRIED = 0.02, 100  # share of the limits, and number, of the motions that must not all be invalid
# Random trajectories that a variant without seeds starts from, and the share of their limits that they use,
# which leaves room to grow; what lies in a box uses all of them, since it is cut.
_RANDOM, _REACH = 2000, 0.6


@dataclass(frozen=True)
class Trained:
    """A trained generator, that of the last epoch, and its metrics after every epoch."""

    generator: TrajectoryGenerator
    history: list[dict[str, float]]
    samples: Array  # images drawn after every epoch, (E · n, 2, …) float32; empty where none were asked for


@dataclass(frozen=True)
class Run:
    """How one training is run."""

    name: str  # of the variant, for files and messages
    seed: int  # of weights, noise and batches
    work: Path  # folder of the checkpoint from which an interrupted training goes on
    evaluation: int = 200  # trajectories whose true physics is measured after every epoch
    samples: int = 0  # trajectories drawn after every epoch, for surrogates to learn from
    device: str = "cpu"  # where the networks run
    progress: Report = lambda done, total: None  # of epochs


def train(settings: Variant, data: Data, run: Run) -> Trained:
    """A generator, trained from the start or from where its training was killed.

    Raises:
        ConfigError: when the variant needs a surrogate that is not given.
        ShapeError: when the seeds do not fit.
        SideganError: when the training diverges; the last whole epoch is kept.
        KeyboardInterrupt: when it is interrupted.
    """
    pl.seed_everything(run.seed, verbose=False)
    data.trajectory.check(data.seeds)
    model = VARIANTS[settings.variant](settings, data, run.name)
    rows = TensorDataset(torch.arange(len(data.seeds)))
    order = RandomSampler(rows, num_samples=model.steps * settings.batch)  # whole passes first
    batches = DataLoader(rows, settings.batch, sampler=order)
    refresh = [] if settings.refresh is None else [Refreshed(settings.refresh, run.seed)]
    fit(model, batches, settings.epochs, [*refresh, EpochMetrics(run)], run.work, run.device)
    files = [_left(run, epoch) for epoch in range(settings.epochs)]
    history, samples = zip(*((one["metrics"], one["samples"]) for one in map(read_tensors, files)))
    return Trained(model.generator.eval(), list(history), torch.cat(samples).numpy())


def _left(run: Run, epoch: int) -> Path:
    """File of a generator's metrics after an epoch, and of what was drawn then."""
    return run.work / f"epoch-{epoch}.pt"


class EpochMetrics(pl.Callback):
    """True physics of what a generator makes after every epoch, left in a file."""

    def __init__(self, run: Run) -> None:
        self.run = run

    @torch.no_grad()
    def on_train_epoch_end(self, trainer: pl.Trainer, pl_module: SideGAN) -> None:  # type: ignore[override]
        """Measure, before Lightning saves its checkpoint."""
        run, epoch, generator = self.run, trainer.current_epoch, pl_module.generator
        noise = torch.Generator().manual_seed(run.seed * 1_000_003 + epoch)
        c = generator.sample(run.evaluation, noise)
        if not np.isfinite(c).all():
            pl_module.stop("not a number")
        data = pl_module.data
        seeds = data.seeds if pl_module.settings.seeded else None
        metrics = measure(data.constraints, data.trajectory, c, seeds)
        samples = generator.images(run.samples, noise).cpu() if run.samples else torch.empty(0)
        write_tensors(_left(run, epoch), {"metrics": metrics, "samples": samples})
        run.progress(epoch + 1, trainer.max_epochs or 0)


def random_trajectories(
    constraints: Constraints, trajectory: Trajectory, seed: int, box: float | None = None
) -> Array:
    """Random trajectories that use much of their limits on motion, in a box, (N, J, H, 2) [rad/s].

    What a variant without seeds starts from, and whose diversity it keeps: they follow from the arm alone.

    Raises:
        InfeasibleError: when not even small motions are valid; says what they violate.
    """
    problem = Problem(constraints, trajectory)
    coordinates = Coordinates.of(problem)
    random, reach = np.random.default_rng(seed), _REACH if box is None else 1.0
    c = coordinates.coefficients(coordinates.start(problem, _RANDOM, random, reach))
    verdict = check(constraints, trajectory, _SMALL / reach * c[:_TRIED])
    if not verdict.valid.any():
        raise InfeasibleError(
            f"the arm cannot even move a little around home: of {_TRIED} random motions that use "
            f"{_SMALL:.0%} of their limits on motion, {summarise_faults(verdict.faults())}"
        )
    return c if box is None else array(Box(box)(tensor(c)))
