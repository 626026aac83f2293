"""The surrogates' work in resumable pieces: label shares, then one training each."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import torch
from torch import Tensor

from sidegan.base.storage import read_torch, write_torch
from sidegan.errors import ArtifactError
from sidegan.gan.labels import MIXTURES, Labelled, Progress, label
from sidegan.gan.pretrain import accuracy, explained, split, train_converter, train_predictor
from sidegan.gan.surrogates import Converter, SuccessPredictor
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.validity import Constraints, check

Network = TypeVar("Network", bound=torch.nn.Module)

_SUCCESS = "success"
_NEAR = 0.05  # share of a limit within which a margin is near zero
_HELD_OUT_SEEDS = 0.15
_HELD_OUT_NEGATIVES = 500
_LEAST_NEGATIVES = 100  # for training


@dataclass(frozen=True)
class Sizes:
    """Widths and time points of the surrogates."""

    width: int
    margin_steps: int
    feature_steps: int


def label_share(
    constraints: Constraints,
    trajectory: Trajectory,
    seeds: Tensor,
    negatives: Tensor,
    count: int,
    steps: int,
    data: str,
    path: Path,
    seed: int,
    progress: Progress,
) -> None:
    """Write ``count`` labelled samples to ``path``, unless they are there: of ``data`` broad or paper."""
    if _readable(path):
        return
    generator = torch.Generator().manual_seed(seed)
    samples = MIXTURES[data](seeds, negatives, count, generator)
    labelled = label(constraints, trajectory, samples, steps, progress)
    write_torch(path, vars(labelled))


def training_seeds(seeds: Tensor) -> tuple[Tensor, Tensor]:
    """Seeds that the surrogates may learn from, and those that are held out."""
    cut = max(1, int(len(seeds) * (1 - _HELD_OUT_SEEDS)))
    return seeds[:cut], seeds[cut:]


def negatives_wanted(samples: int) -> int:
    """Number of a vanilla GAN's samples to draw for that many labelled ones."""
    return max(samples // 2, _LEAST_NEGATIVES + _HELD_OUT_NEGATIVES)


def training_negatives(negatives: Tensor) -> tuple[Tensor, Tensor]:
    """Samples of a vanilla GAN that the surrogates may learn from, and those that are held out."""
    return negatives[:-_HELD_OUT_NEGATIVES], negatives[-_HELD_OUT_NEGATIVES:]


def train_success(
    constraints: Constraints,
    trajectory: Trajectory,
    seeds: Tensor,
    negatives: Tensor,
    shares: Sequence[Path],
    sizes: Sizes,
    epochs: int,
    work: Path,
    seed: int,
    progress: Progress,
) -> dict[str, float]:
    """Held-out accuracies of the success predictor, which is left in ``work``.

    ``accuracy_paper`` is the paper's task (held-out seeds against faulty samples of the vanilla GAN),
    ``accuracy_broad`` is over all held-out samples, ``accuracy_near`` over those whose smallest margin
    is within 5 % of its limit's range of zero.
    """
    data, held, generator = _begin(shares, seed)
    names = len(constraints.labels)
    predictor = SuccessPredictor(constraints.arm, trajectory, names, sizes.width, sizes.margin_steps)
    train_predictor(predictor, data, epochs, generator, progress)
    write_torch(
        work / f"{_SUCCESS}.pt", {"weights": predictor.state_dict(), "sizes": vars(sizes), "names": names}
    )
    held_seeds = training_seeds(seeds)[1]
    faulty = training_negatives(negatives)[1]
    faulty = faulty[~check(constraints, trajectory, faulty).valid]
    c = torch.cat([held_seeds, faulty])
    truth = torch.arange(len(c)) < len(held_seeds)
    near = held.margins.amin((1, 2)).abs() < _NEAR
    return {
        "accuracy_paper": accuracy(predictor, c, truth),
        "accuracy_broad": accuracy(predictor, held.c, held.valid),
        "accuracy_near": accuracy(predictor, held.c[near], held.valid[near]) if near.any() else float("nan"),
        "near_samples": float(near.sum()),
    }


def train_features(
    arm: Arm,
    trajectory: Trajectory,
    features: str,
    shares: Sequence[Path],
    sizes: Sizes,
    epochs: int,
    work: Path,
    seed: int,
    progress: Progress,
) -> dict[str, float | list[float]]:
    """Held-out R² of the converter to ``spectrum`` or ``diagonal``, which is left in ``work``."""
    data, held, generator = _begin(shares, seed)
    target, truth = getattr(data, features), getattr(held, features)
    converter = Converter(arm, trajectory, target.shape[1], sizes.width, sizes.feature_steps)
    train_converter(converter, data.c, target, epochs, generator, progress)
    content = {"weights": converter.state_dict(), "sizes": vars(sizes), "features": target.shape[1]}
    write_torch(work / f"{features}.pt", content)
    r2 = explained(converter, held.c, truth)
    return {f"r2_{features}": r2.tolist(), f"r2_{features}_mean": float(r2.mean())}


def load_predictor(folder: Path, arm: Arm, trajectory: Trajectory) -> SuccessPredictor:
    """The frozen success predictor in ``folder``."""
    content = read_torch(folder / f"{_SUCCESS}.pt")
    sizes = Sizes(**content["sizes"])
    predictor = SuccessPredictor(arm, trajectory, content["names"], sizes.width, sizes.margin_steps)
    return _frozen(predictor, content["weights"], folder)


def load_converter(folder: Path, features: str, arm: Arm, trajectory: Trajectory) -> Converter:
    """The frozen converter to ``features`` in ``folder``."""
    content = read_torch(folder / f"{features}.pt")
    sizes = Sizes(**content["sizes"])
    converter = Converter(arm, trajectory, content["features"], sizes.width, sizes.feature_steps)
    return _frozen(converter, content["weights"], folder)


def _frozen(network: Network, weights: dict[str, Tensor], folder: Path) -> Network:
    try:
        network.load_state_dict(weights)
    except RuntimeError as error:
        raise ArtifactError(f"a surrogate in {folder} does not fit this arm: {error}") from error
    return network.eval().requires_grad_(False)


def _begin(shares: Sequence[Path], seed: int) -> tuple[Labelled, Labelled, torch.Generator]:
    """Training data, held-out data and the random numbers of one training."""
    torch.manual_seed(seed)
    generator = torch.Generator().manual_seed(seed)
    return *split(_load(shares), generator), generator


def _load(shares: Sequence[Path]) -> Labelled:
    parts = [read_torch(path) for path in shares]
    return Labelled(**{key: torch.cat([part[key] for part in parts]) for key in parts[0]})


def _readable(path: Path) -> bool:
    try:
        read_torch(path)
    except ArtifactError:
        return False
    return True
