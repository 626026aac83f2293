"""Train trajectory generators and their surrogates: SIDE-GAN for an arm in its cell."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from numbers import Real
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from sidegan.base.arrays import Array
from sidegan.base.extras import extra
from sidegan.base.names import stamp_of
from sidegan.base.parallel import Job, run_jobs
from sidegan.base.progress import bar
from sidegan.base.random import number, seed_of
from sidegan.base.storage import file_digest, path_of, read_json, write_json, writing
from sidegan.base.typed import changed, settings_of
from sidegan.cell import Cell, coefficients_of, require_cell
from sidegan.errors import ArtifactError, ConfigError, InfeasibleError, ShapeError
from sidegan.gan.settings import SurrogateSettings, Variant, surrogates_recipe, variant_recipe
from sidegan.seeding import refuse_beyond
from sidegan.steps.trajectories import TrajectorySet
from sidegan.validity import summarise_faults

with extra("paper"):
    from sidegan.gan.generator import TrajectoryGenerator
    from sidegan.gan.pretraining import SHARES, Labelled, Pretraining, load_surrogates, negatives_count
    from sidegan.gan.side_gan import Data
    from sidegan.gan.tensors import torch_alone
    from sidegan.gan.training import Trained, TrainingRun, random_trajectories
    from sidegan.gan.training import train_variant as run_training

_CELL = "cell.json"  # beside surrogates: what they were trained for


@dataclass(frozen=True, eq=False, repr=False)
class Generator:
    """A trained generator of trajectories for an arm.

    Attributes:
        network: the network with its scale and limits, a ``torch.nn.Module``.
        history: exact physics of its samples, a row per epoch of training; empty if loaded from a file.
    """

    network: TrajectoryGenerator
    history: pd.DataFrame = field(default_factory=pd.DataFrame)

    def sample(self, count: int, seed: int = 0) -> Array:
        """New coefficients [rad/s], (count, J, H, 2), determined by the seed.

        Raises:
            ConfigError: when the seed is not a whole number ≥ 0.
            ShapeError: when count is not a positive whole number.
        """
        return self.network.sample(count, seed_of(seed))

    def save(self, path: str | Path) -> None:
        """Write a file of tensors and plain values.

        Raises:
            StorageError: when it cannot be written.
        """
        self.network.save(path_of(path, "path"))

    @classmethod
    def load(cls, path: str | Path, cell: Cell) -> "Generator":
        """A generator from a file that ``save`` wrote; no code in the file is executed.

        The file holds the arm with its limits and effort, and the harmonics, period and home of trajectories,
        which must be the cell's, but no workspace: check samples in the cell, as
        ``TrajectorySet.of(cell, generator.sample(100)).valid`` does.

        Raises:
            ArtifactError: for a damaged or foreign file, a different arm or family of trajectories.
        """
        require_cell(cell)
        network = TrajectoryGenerator.load(path_of(path, "path"), cell.arm)
        if network.trajectory != cell.trajectory:
            raise ArtifactError(f"{path} makes {network.trajectory}, the cell has {cell.trajectory}")
        return cls(network)


def train(
    variant: str | Variant | Mapping[str, Any],
    cell: Cell,
    seeds: TrajectorySet | ArrayLike | None = None,
    *,
    surrogates: str | Path | None = None,
    seed: int = 0,
    box: float | None = None,
    folder: str | Path | None = None,
    workers: int | None = None,
    **changes: Any,
) -> Generator:
    """Train a variant of SIDE-GAN.

    The result follows from the arguments, on a given processor and version of torch. Trainings use one
    thread, whatever torch is set to, and take turns if several threads call this; meanwhile, no other code
    should draw from torch's global random numbers, as making and loading networks does.

    Args:
        variant: what a command chooses by ``gan=``: ``"vanilla"``, ``"eigen"``, ``"diagonal"``,
            ``"prediction"`` or ``"exact"``; or the fields of a ``Variant``, such as
            ``{"_target_": "sidegan.gan.variants.Vanilla", "weights": {"adversarial": 1}}``.
        cell: the arm in its cell.
        seeds: training data, a set or coefficients (N, J, H, 2) [rad/s], all valid in the cell; ``"exact"``
            needs none.
        surrogates: folder from ``sidegan.surrogates`` for this cell, to share between variants; None: trains
            them first if the variant needs them.
        seed: random seed.
        box: bound on the absolute coefficients [rad/s] of seeds and generator; None: no bound.
        folder: for finished epochs, so that the same call can resume if interrupted; None: none are kept.
        workers: processes for the surrogates; None: one per core.
        **changes: changes of the variant's settings, fields of ``Variant``, such as ``epochs=20`` or
            ``weights={"rank": 0}``, which keeps the other weights.

    Returns:
        The generator: ``sample(count)``, ``history``, ``save(path)``.

    Raises:
        ConfigError: when there is no such variant, it needs seeds, these reach beyond the box or are
            all the same, or a setting is out of range.
        ShapeError: when the seeds do not fit the cell, or are fewer than two.
        InfeasibleError: when seeds are invalid in the cell; says how many.
        ArtifactError: when the surrogates are of another cell.
        StorageError: when the folder cannot be written.
        SideganError: when the training diverges.
    """
    require_cell(cell)
    name, settings = _settings(variant, changes)
    _require_box(box)
    if not isinstance(surrogates, str | Path | None):
        raise ConfigError(f"surrogates is {surrogates!r}, expected the folder that sidegan.surrogates filled")
    if seeds is None and settings.seeded:
        raise ConfigError(f"{name} learns from seeds, but none are given: seeds=sidegan.seeds(cell)")
    source = None if surrogates is None else Path(surrogates)
    if settings.features and source is not None:
        stored, own = read_json(source / _CELL), json.loads(json.dumps(cell.identity()))
        if differing := [name for name in own if stored.get(name) != own[name]]:
            raise ArtifactError(
                f"the surrogates in {source} were trained for another cell: {', '.join(differing)} differ"
            )
    c = None if seeds is None or not settings.seeded else _examples(seeds, cell, box)
    training_seed = number(seed, f"gan {name}")
    networks = [] if source is None else [file_digest(file) for file in sorted(source.glob("*.pt"))]
    learnt, bound = None if c is None else c.tolist(), None if box is None else float(box)
    # all that the result follows from: other calls have other folders beside this one
    stamp = stamp_of(cell.identity(), name, settings.stamped(), learnt, training_seed, bound, networks)
    with TemporaryDirectory() as temporary, torch_alone():
        work = path_of(temporary if folder is None else folder, "folder") / stamp
        with writing(work):
            work.mkdir(parents=True, exist_ok=True)
        if settings.features and source is None and c is not None:
            source = work / "surrogates"
            if not (source / _CELL).exists():  # which is written last
                _from_vanilla(cell, c, source, surrogates_recipe(), seed, box, workers, work / "negatives")
        with bar(f"epochs of {name}", settings.epochs) as show:
            run = TrainingRun(name, training_seed, work / name, progress=lambda done, total: show(done))
            made = trained(cell, settings, c, run, surrogates=source, box=box)
    return Generator(made.generator, pd.DataFrame(made.history))


def _examples(seeds: TrajectorySet | ArrayLike, cell: Cell, box: float | None) -> Array:
    """Coefficients of seeds [rad/s], (N, J, H, 2), which must be valid in this cell and in the box."""
    c = coefficients_of(seeds, cell)
    found = cell.check(c)
    if len(c) < 2:
        raise ShapeError(f"two seeds or more are needed, got {len(c)}")
    if not found.valid.all():
        raise InfeasibleError(
            f"{np.sum(~found.valid)} of {len(c)} seeds are invalid in this cell: "
            f"{summarise_faults(found.faults())}; make others by sidegan.seeds(cell), or learn from the "
            "valid ones alone: some[some.valid], with some = sidegan.TrajectorySet.of(cell, seeds)"
        )
    refuse_beyond(c, box)
    return c


def _require_box(box: float | None) -> None:
    """Refuse a bound that is not positive by a ConfigError."""
    is_number = isinstance(box, Real) and not isinstance(box, bool)
    if box is not None and not (is_number and 0 < box < math.inf):
        raise ConfigError(f"box is {box!r}, expected a positive number [rad/s]")


def _settings(variant: str | Variant | Mapping[str, Any], changes: dict[str, Any]) -> tuple[str, Variant]:
    """Name and settings of a variant with changes; a ConfigError if there is none."""
    if isinstance(variant, str):
        return variant, changed(variant_recipe(variant), changes)
    if isinstance(variant, Mapping):  # trained for as long as the others, unless it says otherwise
        usual = variant_recipe("vanilla")
        variant = {"epochs": usual.epochs, "steps": usual.steps, **variant}
    own = settings_of(Variant, variant)
    return own.name.lower(), changed(own, changes)


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
    """Train networks that predict validity and excitation, which variants learn from, into a folder.

    Args:
        cell: the arm in its cell.
        seeds: a set or coefficients (N, J, H, 2) [rad/s], all valid in the cell.
        folder: created if missing; ``train(…, surrogates=folder)`` reads it.
        seed: random seed.
        box: bound on the absolute coefficients [rad/s] of seeds and of the generator of further samples;
            None: no bound.
        workers: processes; None: one per core.
        **changes: changes of the settings, fields of ``SurrogateSettings``, such as ``samples=2000``.

    Returns:
        Held-out accuracies of the success predictor and mean R² of the converters, by name.

    Raises:
        ConfigError: when a setting is unknown or out of range, or seeds reach beyond the box.
        ShapeError: when the seeds do not fit the cell, or are fewer than two.
        InfeasibleError: when seeds are invalid in the cell; says how many.
        SideganError: when the training diverges.
    """
    require_cell(cell)
    _require_box(box)
    into = path_of(folder, "folder")
    settings = surrogates_recipe(**changes)
    c = _examples(seeds, cell, box)
    with TemporaryDirectory() as work, torch_alone():
        return _from_vanilla(cell, c, into, settings, seed, box, workers, Path(work))


def _from_vanilla(
    cell: Cell,
    c: Array,
    folder: Path,
    settings: SurrogateSettings,
    seed: int,
    box: float | None,
    workers: int | None,
    work: Path,
) -> dict[str, float]:
    """Train a vanilla GAN, then surrogates from its samples and seeds (N, J, H, 2), into a folder.

    Finished epochs of the GAN are kept in ``work``.
    """
    ((name, variant),) = settings.negatives.items()
    with writing(folder):  # before it is needed, since the training takes long
        folder.mkdir(parents=True, exist_ok=True)
    with bar(f"epochs of {name}", variant.epochs) as show:
        training_seed = number(seed, f"gan {name}")
        run = TrainingRun(name, training_seed, work, progress=lambda done, total: show(done))
        vanilla = trained(cell, variant, c, run, box=box).generator
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
    """Train surrogates from seeds (N, J, H, 2) and samples of a vanilla GAN; their scores, by name."""
    negatives = vanilla.sample(negatives_count(settings.samples), number(seed, "negatives"))
    training = Pretraining(cell.constraints, cell.trajectory, settings, seeds, negatives)
    shares = [partial(training.label, number(seed, f"labels {share}")) for share in range(SHARES)]
    labelled = Labelled.join(run_jobs("labels", shares, workers, settings.samples))
    jobs: list[Job] = [partial(training.train_success, labelled, folder, number(seed, "success"))]
    for name in ("spectrum", "diagonal", "energies"):
        jobs.append(partial(training.train_features, name, labelled, folder, number(seed, name)))
    with writing(folder):
        (folder / _CELL).unlink(missing_ok=True)  # of earlier ones, which the new ones replace one by one
    parts = run_jobs("surrogates", jobs, workers, settings.epochs * len(jobs))
    write_json(folder / _CELL, cell.identity())
    return {key: value for part in parts for key, value in part.items()}


def trained(
    cell: Cell,
    variant: Variant,
    seeds: Array | None,
    run: TrainingRun,
    *,
    surrogates: Path | None = None,
    box: float | None = None,
) -> Trained:
    """Train a variant, or resume its interrupted training.

    It learns from seeds, coefficients [rad/s], (N, J, H, 2), or from random trajectories if None, and from
    the surrogates in a folder; ``box`` bounds its absolute coefficients [rad/s] if its generator is boxed.
    Raises the errors of ``sidegan.gan.training.train_variant``, and an ArtifactError if a surrogate is
    missing, damaged, or for a different arm.
    """
    box = box if variant.generator.boxed else None
    if seeds is None:
        seeds = random_trajectories(cell.constraints, cell.trajectory, run.seed, box)
    data = Data(cell.constraints, cell.trajectory, seeds, box=box)
    if surrogates is not None and variant.features:
        predictor, converter = load_surrogates(surrogates, variant, cell.arm, cell.trajectory)
        data = replace(data, success_predictor=predictor, converter=converter)
    return run_training(variant, data, run)
