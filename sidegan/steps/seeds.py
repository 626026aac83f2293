"""The seed set: optimised trajectories that generators learn from."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from sidegan.base.names import stamp_of
from sidegan.base.random import seed_of, stream
from sidegan.base.storage import path_of, writing
from sidegan.base.typed import changed, settings_of
from sidegan.cell import Cell, require_cell
from sidegan.design.problem import Problem
from sidegan.errors import ConfigError
from sidegan.seeding import SeedBatch, Seeds, make_seeds, seeds_recipe
from sidegan.steps.trajectories import TrajectorySet


def seeds(
    cell: Cell,
    count: int | None = None,
    seed: int = 0,
    *,
    settings: Seeds | Mapping[str, Any] | None = None,
    folder: str | Path | None = None,
    workers: int | None = None,
) -> TrajectorySet:
    """Optimise valid trajectories that are well conditioned and different from each other.

    Args:
        cell: the arm in its cell.
        count: number N of trajectories; None: that of the settings, or 400.
        seed: random seed; the same seed gives the same set for any number of workers.
        settings: the optimiser and its effort: the fields of ``sidegan.seeding.Seeds``; for the paper's own
            optimiser, which takes seconds per seed, ``{"method": "paper"}``.
        folder: for finished parts, so that the same call can resume if interrupted; None: none are kept.
        workers: processes; None: one per core.

    Returns:
        The set: ``coefficients`` (N, J, H, 2) [rad/s], ``conditions`` (N,), ``motion(rate)``, ``to_frame()``.

    Raises:
        ConfigError: when a setting is unknown or out of range, or the method is ``published``.
        ShapeError: when ``settings.samples`` is too small for the harmonics of the cell.
        InfeasibleError: when too few starts become valid; names the violated constraints.
        StorageError: when the folder cannot be written.
    """
    require_cell(cell)
    seed = seed_of(seed)
    chosen = _chosen(settings)
    chosen = chosen if count is None else changed(chosen, {"count": count})
    with TemporaryDirectory() as temporary:
        # other calls have other folders beside this one
        kept = path_of(temporary if folder is None else folder, "folder")
        work = kept / stamp_of(cell.identity(), asdict(chosen), seed)
        with writing(work):
            work.mkdir(parents=True, exist_ok=True)
        made = optimised(cell, chosen, seed, work, workers)
    return TrajectorySet.of(cell, made.coefficients, chosen.method)


def _chosen(settings: Seeds | Mapping[str, Any] | None) -> Seeds:
    """Settings as given, with the defaults of their method; a ConfigError if they are wrong."""
    given = settings or {}
    method = given.get("method") if isinstance(given, Mapping) else getattr(given, "method", None)
    if method == "published":
        raise ConfigError("method published reads files: use sidegan.seeding.published.PublishedSeeds")
    return seeds_recipe(**given) if isinstance(given, Mapping) else settings_of(Seeds, given)


def optimised(cell: Cell, settings: Seeds, seed: int, work: Path, workers: int | None) -> SeedBatch:
    """Seeds by the settings' optimiser, with statistics; finished parts are kept in ``work``.

    Raises:
        InfeasibleError: when too few starts become valid; names the violated constraints.
    """
    return make_seeds(
        Problem(cell.constraints, cell.trajectory, settings.samples, settings.strongest),
        settings.optimiser,
        settings.count,
        stream(seed, "seeds"),
        batch=settings.batch,
        work=work,
        workers=workers,
    )
