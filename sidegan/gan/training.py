"""Train a variant, and measure its samples with exact physics after every epoch."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytorch_lightning as pl
import torch
from torch.utils.data import DataLoader, RandomSampler, TensorDataset

from sidegan.base.arrays import Array
from sidegan.base.parallel import Report
from sidegan.design.problem import Coordinates, Problem
from sidegan.errors import ConfigError, InfeasibleError
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
class Run:
    """Options of a training run."""

    name: str  # of the variant, for files and messages
    seed: int  # of weights, noise and batches
    work: Path  # folder of checkpoints to resume from
    evaluation: int = 200  # trajectories to evaluate with exact physics after every epoch
    samples: int = 0  # trajectories to keep of every epoch, for surrogates to learn from
    device: str = "cpu"  # of the networks
    progress: Report = lambda done, total: None  # in epochs


def train(settings: Variant, data: Data, run: Run) -> Trained:
    """Train a generator, or resume its interrupted training.

    Raises:
        ConfigError: when a surrogate is missing, or all seeds are the same.
        ShapeError: when the seeds do not fit.
        SideganError: when the training diverges.
        KeyboardInterrupt: when interrupted.
    """
    torch.manual_seed(run.seed)
    data.trajectory.check(data.seeds)
    if len(data.seeds) > 1 and not np.ptp(data.seeds, axis=0).any():
        raise ConfigError(f"all {len(data.seeds)} seeds are the same trajectory, expected different ones")
    model = VARIANTS[settings.variant](settings, data, run.name)
    rows = TensorDataset(torch.arange(len(data.seeds)))
    order = RandomSampler(rows, num_samples=model.steps * settings.batch)  # without replacement in each pass
    batches = DataLoader(rows, settings.batch, sampler=order)
    refresh = [] if settings.refresh is None else [Refreshed(settings.refresh, run.seed)]
    fit(model, batches, settings.epochs, [*refresh, EpochMetrics(run)], run.work, run.device)
    files = [_epoch_file(run, epoch) for epoch in range(settings.epochs)]
    history, samples = zip(*((epoch["metrics"], epoch["samples"]) for epoch in map(read_tensors, files)))
    return Trained(model.generator.eval(), list(history), torch.cat(samples).numpy())


def _epoch_file(run: Run, epoch: int) -> Path:
    """File of a generator's metrics and samples after an epoch."""
    return run.work / f"epoch-{epoch}.pt"


class EpochMetrics(pl.Callback):
    """Measure a generator's samples with exact physics after every epoch, and save the metrics."""

    def __init__(self, run: Run) -> None:
        self.run = run

    @torch.no_grad()
    def on_train_epoch_end(self, trainer: pl.Trainer, pl_module: SideGAN) -> None:  # type: ignore[override]
        """Measure before Lightning saves its checkpoint."""
        run = self.run
        epoch = trainer.current_epoch
        generator = pl_module.generator
        noise = torch.Generator().manual_seed(run.seed * 1_000_003 + epoch)
        c = generator.sample(run.evaluation, noise)
        if not np.isfinite(c).all():
            pl_module.stop("its trajectories are not finite")
        data = pl_module.data
        seeds = data.seeds if pl_module.settings.seeded else None
        metrics = measure(data.constraints, data.trajectory, c, seeds)
        samples = generator.images(run.samples, noise).cpu() if run.samples else torch.empty(0)
        write_tensors(_epoch_file(run, epoch), {"metrics": metrics, "samples": samples})
        run.progress(epoch + 1, trainer.max_epochs or 0)


def random_trajectories(
    constraints: Constraints, trajectory: Trajectory, seed: int, box: float | None = None
) -> Array:
    """Random trajectories [rad/s], (N, J, H, 2), in a box, that use much of the limits on motion.

    They replace seeds as the start of a variant without them, and as its target of diversity.

    Raises:
        InfeasibleError: when not even small motions are valid; names the violated constraints.
    """
    problem = Problem(constraints, trajectory)
    coordinates = Coordinates.of(problem)
    random = np.random.default_rng(seed)
    reach = _REACH if box is None else 1.0
    c = coordinates.coefficients(coordinates.start(problem, _RANDOM, random, reach))
    verdict = check(constraints, trajectory, _SMALL / reach * c[:_TRIED])
    if not verdict.valid.any():
        raise InfeasibleError(
            f"the arm cannot even move a little around home: of {_TRIED} random motions that use "
            f"{_SMALL:.0%} of their limits on motion, {summarise_faults(verdict.faults())}"
        )
    return c if box is None else array(Box(box)(tensor(c)))
