"""Generators of trajectories: a variant of SIDE-GAN, trained."""

from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd
from numpy.typing import ArrayLike

from sidegan.base.arrays import Array
from sidegan.base.extras import extra
from sidegan.base.random import number
from sidegan.base.typed import build
from sidegan.cell import Cell
from sidegan.errors import ConfigError
from sidegan.gan.settings import RECIPES, Variant
from sidegan.steps.surrogates import surrogates as train_surrogates
from sidegan.steps.trained import trained
from sidegan.steps.trajectories import TrajectorySet, coefficients_of

with extra("paper"):
    from sidegan.gan.generator import TrajectoryGenerator
    from sidegan.gan.training import Run


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
        raise ConfigError(f"{name} learns from seeds, which are not given: seeds=sidegan.seeds(cell)")
    c = None if seeds is None or not settings.seeded else coefficients_of(seeds)
    with TemporaryDirectory() as work:
        folder = None if surrogates is None else Path(surrogates)
        if settings.features and folder is None and c is not None:
            folder = Path(work, "surrogates")
            train_surrogates(cell, c, folder, seed=seed, box=box, workers=workers)
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
