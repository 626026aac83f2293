"""The training of one variant on an arm in its cell."""

from dataclasses import replace
from pathlib import Path

from sidegan.base.arrays import Array
from sidegan.base.extras import extra
from sidegan.cell import Cell
from sidegan.gan.settings import Variant

with extra("paper"):
    from sidegan.gan.pretraining import load_surrogates
    from sidegan.gan.side_gan import Data
    from sidegan.gan.training import Run, Trained, random_trajectories, train


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

    Args:
        cell: the arm in its cell.
        variant: its settings.
        seeds: coefficients [rad/s], (N, J, H, 2); None: random trajectories in their place.
        run: how it is run.
        surrogates: folder of those that it learns from; None where it has none.
        box: largest absolute coefficient [rad/s] that it may yield; None: any.

    Raises:
        ArtifactError: when a surrogate is missing, damaged, or of another arm.
        ConfigError, ShapeError, SideganError, KeyboardInterrupt: as ``sidegan.gan.training.train`` does.
    """
    if seeds is None:
        seeds = random_trajectories(cell.constraints, cell.trajectory, run.seed, box)
    data = Data(cell.constraints, cell.trajectory, seeds, box=box)
    if surrogates is not None and variant.features:
        predictor, converter = load_surrogates(surrogates, variant, cell.arm, cell.trajectory)
        data = replace(data, success_predictor=predictor, converter=converter)
    return train(variant, data, run)
