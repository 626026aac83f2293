"""The surrogates' work in resumable pieces: shares of labelled samples, then one training each."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import torch
from torch import Tensor

from sidegan.base.parallel import Report
from sidegan.base.storage import read_torch, readable, write_task
from sidegan.errors import ArtifactError
from sidegan.gan.labels import Labelled, blend, label
from sidegan.gan.pretrain import accuracy, explained, split, train_converter, train_predictor
from sidegan.gan.surrogates import Converter, SuccessPredictor, Surrogates, SurrogateSettings
from sidegan.gan.variants import Variant
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.validity import Constraints, check

Network = TypeVar("Network", bound=torch.nn.Module)

SHARES = 8  # of the labelled samples, one job each
_SUCCESS = "success"
_NEAR = 0.05  # share of a limit within which a margin is near zero
_HELD_OUT_SEEDS = 0.15
_HELD_OUT_NEGATIVES = 500
_LEAST_NEGATIVES = 100  # for training


@dataclass(frozen=True)
class Pretraining:
    """What the surrogates of an arm learn from, and how."""

    constraints: Constraints  # the arm in its workspace
    trajectory: Trajectory  # the family of trajectories
    settings: SurrogateSettings  # numbers of samples and epochs, sizes of the networks
    seeds: Tensor  # coefficients [rad/s], (N, J, H, 2)
    negatives: Tensor  # a vanilla GAN's samples, as many as ``negatives_count`` says or more
    work: Path  # folder of the labelled samples

    def label(self, share: int, seed: int, progress: Report) -> None:
        """Write one share of the labelled samples, unless it is there."""
        path, generator = self._share(share), torch.Generator().manual_seed(seed)
        if readable(path):
            return
        sources = training_seeds(self.seeds)[0], self.negatives[:-_HELD_OUT_NEGATIVES]
        samples = blend(*sources, -(-self.settings.samples // SHARES), generator)
        steps = self.settings.margin_steps
        write_task(path, vars(label(self.constraints, self.trajectory, samples, steps, progress)))

    def train_success(self, folder: Path, seed: int, progress: Report) -> dict[str, float]:
        """Held-out accuracies of the success predictor, which is left in ``folder``.

        ``accuracy_paper`` is the paper's task (held-out seeds against faulty samples of the vanilla GAN),
        ``accuracy_broad`` is over all held-out samples, ``accuracy_near`` over those whose smallest margin
        is within 5 % of its limit's range of zero.
        """
        data, held, generator = self._begin(seed)
        content = {"sizes": _sizes(self.settings), "names": len(self.constraints.labels)}
        predictor = _predictor(self.constraints.arm, self.trajectory, content)
        train_predictor(predictor, data, self.settings.epochs, generator, progress)
        write_task(folder / f"{_SUCCESS}.pt", content | {"weights": predictor.state_dict()})
        held_seeds, faulty = training_seeds(self.seeds)[1], self.negatives[-_HELD_OUT_NEGATIVES:]
        faulty = faulty[~check(self.constraints, self.trajectory, faulty).valid]
        c = torch.cat([held_seeds, faulty])
        near = held.margins.amin((1, 2)).abs() < _NEAR
        on_near = accuracy(predictor, held.c[near], held.valid[near]) if near.any() else float("nan")
        return {
            "accuracy_paper": accuracy(predictor, c, torch.arange(len(c)) < len(held_seeds)),
            "accuracy_broad": accuracy(predictor, held.c, held.valid),
            "accuracy_near": on_near,
            "near_samples": float(near.sum()),
        }

    def train_features(
        self, features: str, folder: Path, seed: int, progress: Report
    ) -> dict[str, float | list[float]]:
        """Held-out R² of the converter to ``spectrum`` or ``diagonal``, which is left in ``folder``."""
        data, held, generator = self._begin(seed)
        target = getattr(data, features)
        content = {"sizes": _sizes(self.settings), "features": target.shape[1]}
        converter = _converter(self.constraints.arm, self.trajectory, content)
        train_converter(converter, data.c, target, self.settings.epochs, generator, progress)
        write_task(folder / f"{features}.pt", content | {"weights": converter.state_dict()})
        r2 = explained(converter, held.c, getattr(held, features))
        return {f"r2_{features}": r2.tolist(), f"r2_{features}_mean": float(r2.mean())}

    def _share(self, number: int) -> Path:
        return self.work / f"labels-{number}.pt"

    def _begin(self, seed: int) -> tuple[Labelled, Labelled, torch.Generator]:
        """Training data, held-out data and the random numbers of one training."""
        torch.manual_seed(seed)
        generator = torch.Generator().manual_seed(seed)
        labelled = Labelled.cat([read_torch(self._share(number)) for number in range(SHARES)])
        return *split(labelled, generator), generator


def training_seeds(seeds: Tensor) -> tuple[Tensor, Tensor]:
    """Seeds that the surrogates may learn from, and those that are held out."""
    cut = max(1, int(len(seeds) * (1 - _HELD_OUT_SEEDS)))
    return seeds[:cut], seeds[cut:]


def negatives_count(samples: int) -> int:
    """Number of a vanilla GAN's samples to draw: half of the labelled ones, with what is held out."""
    return max(samples // 2, _LEAST_NEGATIVES + _HELD_OUT_NEGATIVES)


def load_surrogates(folder: Path | None, variant: Variant, arm: Arm, trajectory: Trajectory) -> Surrogates:
    """Frozen surrogates that a variant learns from, as far as it does, from their folder.

    Raises:
        ArtifactError: when one is missing, damaged, or of another arm.
    """
    predictor = converter = None
    if folder is not None and variant.weights.success > 0:
        content = read_torch(folder / f"{_SUCCESS}.pt")
        predictor = _frozen(_predictor(arm, trajectory, content), content["weights"], folder)
    if folder is not None and variant.features != "none":
        content = read_torch(folder / f"{variant.features}.pt")
        converter = _frozen(_converter(arm, trajectory, content), content["weights"], folder)
    return Surrogates(predictor, converter)


def _predictor(arm: Arm, trajectory: Trajectory, content: dict[str, Any]) -> SuccessPredictor:
    sizes = content["sizes"]
    return SuccessPredictor(arm, trajectory, content["names"], sizes["width"], sizes["margin_steps"])


def _converter(arm: Arm, trajectory: Trajectory, content: dict[str, Any]) -> Converter:
    sizes = content["sizes"]
    return Converter(arm, trajectory, content["features"], sizes["width"], sizes["feature_steps"])


def _sizes(settings: SurrogateSettings) -> dict[str, int]:
    """Sizes of the networks, as their files keep them."""
    return {key: getattr(settings, key) for key in ("width", "margin_steps", "feature_steps")}


def _frozen(network: Network, weights: dict[str, Tensor], folder: Path) -> Network:
    try:
        network.load_state_dict(weights)
    except RuntimeError as error:
        raise ArtifactError(f"a surrogate in {folder} does not fit this arm: {error}") from error
    return network.eval().requires_grad_(False)
