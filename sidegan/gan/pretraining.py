"""Training of the surrogates in resumable pieces: shares of labelled samples, then one training each."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pytorch_lightning as pl
import torch
from torch import Tensor

from sidegan.base.parallel import Report
from sidegan.base.storage import read_torch, readable, write_task
from sidegan.errors import ArtifactError
from sidegan.gan.labels import Labelled, blend, label
from sidegan.gan.published_surrogates import PublishedConverter, PublishedPredictor
from sidegan.gan.settings import SurrogateSettings, Variant
from sidegan.gan.surrogates import Converter, SuccessPredictor, Surrogate
from sidegan.gan.trainer import Progress, Shuffled, fit
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.validity import Constraints, check

SHARES = 8  # of the labelled samples, one job each
_SUCCESS = "success"
_BATCH = 100
_NEAR = 0.05  # share of a limit within which a margin is near zero
_HELD_OUT_SEEDS = 0.15
_HELD_OUT_NEGATIVES = 500
_LEAST_NEGATIVES = 100  # for training


@dataclass(frozen=True)
class Pretraining:
    """Data and settings from which the surrogates of an arm learn."""

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
        data, held, random = self._begin(seed)
        sizes = {"width": self.settings.width, "steps": self.settings.margin_steps}
        arguments = {"constraints": len(self.constraints.labels), **sizes}
        predictor = SuccessPredictor(self.constraints.arm, self.trajectory, **arguments)
        self._fit(predictor, (data.c, data.margins, data.valid), random, progress)
        write_task(folder / f"{_SUCCESS}.pt", {"arguments": arguments, "weights": predictor.state_dict()})
        held_seeds, faulty = training_seeds(self.seeds)[1], self.negatives[-_HELD_OUT_NEGATIVES:]
        faulty = faulty[~check(self.constraints, self.trajectory, faulty).valid]
        c = torch.cat([held_seeds, faulty])
        near = held.margins.amin((1, 2)).abs() < _NEAR
        on_near = predictor.accuracy(held.c[near], held.valid[near]) if near.any() else float("nan")
        return {
            "accuracy_paper": predictor.accuracy(c, torch.arange(len(c)) < len(held_seeds)),
            "accuracy_broad": predictor.accuracy(held.c, held.valid),
            "accuracy_near": on_near,
            "near_samples": float(near.sum()),
        }

    def train_features(
        self, features: str, folder: Path, seed: int, progress: Report
    ) -> dict[str, float | list[float]]:
        """Held-out R² of the converter to ``spectrum`` or ``diagonal``, which is left in ``folder``."""
        data, held, random = self._begin(seed)
        target = getattr(data, features)
        sizes = {"width": self.settings.width, "steps": self.settings.feature_steps}
        arguments = {"features": target.shape[1], **sizes}
        converter = Converter(self.constraints.arm, self.trajectory, **arguments)
        converter.fit_standard(target)
        self._fit(converter, (data.c, converter.standardise(target)), random, progress)
        write_task(folder / f"{features}.pt", {"arguments": arguments, "weights": converter.state_dict()})
        r2 = converter.explained(held.c, getattr(held, features))
        return {f"r2_{features}": r2.tolist(), f"r2_{features}_mean": float(r2.mean())}

    def _share(self, number: int) -> Path:
        return self.work / f"labels-{number}.pt"

    def _begin(self, seed: int) -> tuple[Labelled, Labelled, torch.Generator]:
        """Training data, held-out data and the random numbers of one training."""
        torch.manual_seed(seed)
        random = torch.Generator().manual_seed(seed)
        labelled = Labelled.cat([read_torch(self._share(number)) for number in range(SHARES)])
        return *labelled.split(random), random

    def _fit(
        self, network: Surrogate, tensors: Sequence[Tensor], random: torch.Generator, progress: Report
    ) -> None:
        batches, epochs = Shuffled(tensors, _BATCH, random), self.settings.epochs
        fit(network, batches, epochs, [Progress(progress, epochs * len(batches))])
        network.freeze()


def training_seeds(seeds: Tensor) -> tuple[Tensor, Tensor]:
    """Seeds that the surrogates may learn from, and those that are held out."""
    cut = max(1, int(len(seeds) * (1 - _HELD_OUT_SEEDS)))
    return seeds[:cut], seeds[cut:]


def negatives_count(samples: int) -> int:
    """Number of a vanilla GAN's samples to draw: half of the labelled ones, with what is held out."""
    return max(samples // 2, _LEAST_NEGATIVES + _HELD_OUT_NEGATIVES)


def load_surrogates(
    folder: Path, variant: Variant, arm: Arm, trajectory: Trajectory
) -> tuple[pl.LightningModule, pl.LightningModule]:
    """Frozen success predictor and converter of a variant with features, from their folder.

    Raises:
        ArtifactError: when one is missing, damaged, or of another arm.
    """
    success, features = folder / f"{_SUCCESS}.pt", folder / f"{variant.features}.pt"
    if variant.published is not None:
        return _load(success, PublishedPredictor), _load(features, PublishedConverter)
    predictor = _load(success, partial(SuccessPredictor, arm, trajectory))
    return predictor, _load(features, partial(Converter, arm, trajectory))


def _load(path: Path, kind: Callable[..., pl.LightningModule]) -> pl.LightningModule:
    content = read_torch(path)
    try:
        network = kind(**content["arguments"])
        network.load_state_dict(content["weights"])
    except (LookupError, TypeError, RuntimeError) as error:
        raise ArtifactError(f"{path} does not fit this arm: {error}") from error
    network.freeze()
    return network
