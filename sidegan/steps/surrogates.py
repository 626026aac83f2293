"""The surrogates of an arm in its cell: success predictor and converters, which stand for the physics."""

from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from numpy.typing import ArrayLike

from sidegan.base.arrays import Array
from sidegan.base.extras import extra
from sidegan.base.parallel import Job, run_jobs
from sidegan.base.random import number
from sidegan.base.typed import build
from sidegan.cell import Cell
from sidegan.gan.settings import SurrogateSettings
from sidegan.steps.trained import trained
from sidegan.steps.trajectories import TrajectorySet, coefficients_of

with extra("paper"):
    from sidegan.gan.generator import TrajectoryGenerator
    from sidegan.gan.labels import Labelled
    from sidegan.gan.pretraining import SHARES, Pretraining, negatives_count
    from sidegan.gan.training import Run


def surrogates(
    cell: Cell,
    seeds: TrajectorySet | ArrayLike,
    folder: str | Path,
    *,
    seed: int = 0,
    box: float | None = None,
    workers: int | None = None,
    **changes: Any,
) -> dict[str, float]:
    """Networks that tell what is valid and how it excites, from which variants learn; left in a folder.

    Args:
        cell: the arm in its cell.
        seeds: a set or coefficients (N, J, H, 2) [rad/s].
        folder: which is made when it is missing; ``train(…, surrogates=folder)`` reads it.
        seed: of all random numbers.
        box: largest absolute coefficient [rad/s] of the generator that they learn from beside; None: any.
        workers: processes; None: one per core.
        **changes: of the settings, fields of ``SurrogateSettings``, such as ``samples=2000``.

    Returns:
        Held-out accuracies of the success predictor and mean R² of the converters, by their names.

    Raises:
        ConfigError: when a setting is unknown or out of range.
        ShapeError: when the seeds do not fit the cell.
        SideganError: when the training diverges.
    """
    settings, c = build(SurrogateSettings, changes), coefficients_of(seeds)
    ((name, variant),) = settings.negatives.items()
    with TemporaryDirectory() as work:
        run = Run(name, number(seed, f"gan {name}"), Path(work))
        vanilla = trained(cell, variant, c, run, box=box if variant.boxed else None).generator
    Path(folder).mkdir(parents=True, exist_ok=True)
    return pretrain(cell, c, vanilla, settings, Path(folder), seed=seed, workers=workers)


def pretrain(
    cell: Cell,
    seeds: Array,
    vanilla: TrajectoryGenerator,
    settings: SurrogateSettings,
    folder: Path,
    *,
    seed: int,
    workers: int | None,
) -> dict[str, float]:
    """Surrogates from seeds (N, J, H, 2) and what a vanilla GAN makes; how good they are, by their names."""
    faulty = vanilla.sample(negatives_count(settings.samples), number(seed, "negatives"))
    training = Pretraining(cell.constraints, cell.trajectory, settings, seeds, faulty)
    shares = [partial(training.label, number(seed, f"labels {share}")) for share in range(SHARES)]
    labelled = Labelled.join(run_jobs("labels", shares, workers, settings.samples))
    jobs: list[Job] = [partial(training.train_success, labelled, folder, number(seed, "success"))]
    for name in ("spectrum", "diagonal", "energies"):
        jobs.append(partial(training.train_features, name, labelled, folder, number(seed, name)))
    parts = run_jobs("surrogates", jobs, workers, settings.epochs * len(jobs))
    return {key: value for part in parts for key, value in part.items()}
