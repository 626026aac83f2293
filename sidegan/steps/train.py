"""Generators of trajectories, and the surrogates that they learn from: SIDE-GAN on an arm in its cell."""

from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd
from numpy.typing import ArrayLike

from sidegan.base.arrays import Array
from sidegan.base.extras import extra
from sidegan.base.parallel import Job, run_jobs
from sidegan.base.random import number
from sidegan.base.typed import build
from sidegan.cell import Cell
from sidegan.errors import ConfigError
from sidegan.gan.settings import RECIPES, SurrogateSettings, Variant
from sidegan.steps.trajectories import TrajectorySet, coefficients_of

with extra("paper"):
    from sidegan.gan.generator import TrajectoryGenerator
    from sidegan.gan.labels import Labelled
    from sidegan.gan.pretraining import SHARES, Pretraining, load_surrogates, negatives_count
    from sidegan.gan.side_gan import Data
    from sidegan.gan.training import Run, Trained, random_trajectories
    from sidegan.gan.training import train as run_training


class Generator:
    """A trained generator of trajectories of one arm.

    Attributes:
        network: the network with its scale and limits, a ``torch.nn.Module``.
        history: true physics of what it made after every epoch of its training, a row each; empty for one
            that was read from a file.
    """

    def __init__(self, network: TrajectoryGenerator, history: pd.DataFrame | None = None) -> None:
        self.network = network
        self.history = pd.DataFrame() if history is None else history

    def sample(self, count: int, seed: int = 0) -> Array:
        """New coefficients [rad/s], (count, J, H, 2); the same for the same seed.

        Raises:
            ShapeError: when count is not positive.
        """
        return self.network.sample(count, seed)

    def save(self, path: str | Path) -> None:
        """Write one file of tensors and plain values.

        Raises:
            StorageError: when it cannot be written.
        """
        self.network.save(Path(path))

    @classmethod
    def load(cls, path: str | Path, cell: Cell) -> "Generator":
        """A generator from a file that ``save`` wrote; no code in the file is run.

        Raises:
            ArtifactError: for a truncated or foreign file, or another arm.
        """
        return cls(TrajectoryGenerator.load(Path(path), cell.arm))


def train(
    variant: str | Variant,
    cell: Cell,
    seeds: TrajectorySet | ArrayLike | None = None,
    *,
    surrogates: str | Path | None = None,
    seed: int = 0,
    box: float | None = None,
    workers: int | None = None,
    **changes: Any,
) -> Generator:
    """A variant of SIDE-GAN, trained.

    Args:
        variant: ``"vanilla"``, ``"eigen"``, ``"diagonal"``, ``"prediction"`` or ``"exact"``; or settings.
        cell: the arm in its cell.
        seeds: what it learns from, a set or coefficients (N, J, H, 2) [rad/s]; ``"exact"`` needs none.
        surrogates: folder that ``sidegan.surrogates`` filled, for several variants; None: they are trained
            first, where the variant learns from them.
        seed: of all random numbers.
        box: largest absolute coefficient [rad/s] that the generator may yield; None: any.
        workers: processes for the surrogates; None: one per core.
        **changes: of the variant's settings, fields of ``Variant``, such as ``epochs=20``.

    Returns:
        The generator: ``sample(count)``, ``history``, ``save(path)``.

    Raises:
        ConfigError: when there is no such variant, it needs seeds, or a setting is out of range.
        ShapeError: when the seeds do not fit the cell.
        SideganError: when the training diverges.
    """
    name, settings = _settings(variant, changes)
    if seeds is None and settings.seeded:
        raise ConfigError(f"{name} learns from seeds, but none are given: seeds=sidegan.seeds(cell)")
    c = None if seeds is None or not settings.seeded else coefficients_of(seeds)
    with TemporaryDirectory() as work:
        folder = None if surrogates is None else Path(surrogates)
        if settings.features and folder is None and c is not None:
            folder = Path(work, "surrogates")
            _from_vanilla(cell, c, folder, SurrogateSettings(), seed, box, workers)
        run = Run(name, number(seed, f"gan {name}"), Path(work, name))
        own = box if settings.boxed else None
        made = trained(cell, settings, c, run, surrogates=folder, box=own)
    return Generator(made.generator, pd.DataFrame(made.history))


def _settings(variant: str | Variant, changes: dict[str, Any]) -> tuple[str, Variant]:
    """Name and settings of a variant with changes; a ConfigError where there is none."""
    if isinstance(variant, str) and variant not in RECIPES:
        raise ConfigError(f"there is no variant {variant!r}, expected one of {', '.join(RECIPES)}")
    recipe = RECIPES[variant] if isinstance(variant, str) else variant
    name = variant if isinstance(variant, str) else recipe.variant.lower()
    return name, build(Variant, {**asdict(recipe), **changes})


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
    settings = build(SurrogateSettings, changes)
    return _from_vanilla(cell, coefficients_of(seeds), Path(folder), settings, seed, box, workers)


def _from_vanilla(
    cell: Cell,
    c: Array,
    folder: Path,
    settings: SurrogateSettings,
    seed: int,
    box: float | None,
    workers: int | None,
) -> dict[str, float]:
    """Surrogates in a folder, from seeds (N, J, H, 2) and a vanilla GAN that is trained for them."""
    ((name, variant),) = settings.negatives.items()
    with TemporaryDirectory() as work:
        run = Run(name, number(seed, f"gan {name}"), Path(work))
        vanilla = trained(cell, variant, c, run, box=box if variant.boxed else None).generator
    folder.mkdir(parents=True, exist_ok=True)
    return pretrain(cell, c, vanilla, settings, folder, seed=seed, workers=workers)


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


def trained(
    cell: Cell,
    variant: Variant,
    seeds: Array | None,
    run: Run,
    *,
    surrogates: Path | None = None,
    box: float | None = None,
) -> Trained:
    """A variant, trained from the start or from where its training was killed.

    It learns from seeds, coefficients [rad/s], (N, J, H, 2), or from random trajectories where there are
    none, and from the surrogates in a folder. It may yield coefficients within a box [rad/s] alone. Errors
    are those of ``sidegan.gan.training.train``, and an ArtifactError where a surrogate is missing, damaged,
    or of another arm.
    """
    if seeds is None:
        seeds = random_trajectories(cell.constraints, cell.trajectory, run.seed, box)
    data = Data(cell.constraints, cell.trajectory, seeds, box=box)
    if surrogates is not None and variant.features:
        predictor, converter = load_surrogates(surrogates, variant, cell.arm, cell.trajectory)
        data = replace(data, success_predictor=predictor, converter=converter)
    return run_training(variant, data, run)
