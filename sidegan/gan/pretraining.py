"""Training of the surrogates: label samples with exact physics in parallel, then train each network."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pytorch_lightning as pl
import torch
from torch import Tensor

from sidegan.base.arrays import Array
from sidegan.base.parallel import Report
from sidegan.errors import ArtifactError
from sidegan.gan.labels import Labelled, blend, label
from sidegan.gan.published_surrogates import PublishedConverter, PublishedPredictor
from sidegan.gan.reward import Energies
from sidegan.gan.settings import SurrogateSettings, Variant
from sidegan.gan.surrogates import Converter, SuccessPredictor, Surrogate
from sidegan.gan.tensors import array, read_tensors, tensor, write_network
from sidegan.gan.trainer import Progress, Shuffled, fit
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.validity import Constraints, check

SHARES = 8  # jobs that label the samples
_BATCH = 100
_HELD_OUT = 0.15  # of the seeds, and of the labelled samples
_HELD_OUT_NEGATIVES = 500
_LEAST_NEGATIVES = 100  # for training


@dataclass(frozen=True)
class Pretraining:
    """Data and settings for training an arm's surrogates."""

    constraints: Constraints  # the arm in its workspace
    trajectory: Trajectory  # the family of trajectories
    settings: SurrogateSettings  # numbers of samples and epochs, sizes of the networks
    seeds: Array  # coefficients [rad/s], (N, J, H, 2)
    negatives: Array  # at least ``negatives_count`` samples of a vanilla GAN

    def label(self, seed: int, progress: Report) -> Labelled:
        """One of ``SHARES`` shares of the labelled samples."""
        sources = self.seeds[: self._learnt], self.negatives[:-_HELD_OUT_NEGATIVES]
        samples = blend(*sources, -(-self.settings.samples // SHARES), seed)
        energies = Energies(self.constraints, self.trajectory, self.seeds)
        steps = self.settings.margin_steps
        return label(self.constraints, self.trajectory, samples, steps, progress, energies)

    def train_success(
        self, labelled: Labelled, folder: Path, seed: int, progress: Report
    ) -> dict[str, float]:
        """Train the success predictor, save it in ``folder``, and return its held-out accuracies.

        ``accuracy_paper`` is the paper's task (held-out seeds against faulty samples of the vanilla GAN),
        ``accuracy_broad`` is over all held-out samples.
        """
        data, held, random = _begin(labelled, seed)
        sizes = {"width": self.settings.width, "steps": self.settings.margin_steps}
        arguments = {"constraints": len(self.constraints.labels), **sizes}
        predictor = SuccessPredictor(self.constraints.arm, self.trajectory, **arguments)
        self._fit(predictor, [tensor(x) for x in (data.c, data.margins, data.valid)], random, progress)
        write_network(folder / "success.pt", predictor.state_dict(), arguments)
        held_seeds, faulty = self.seeds[self._learnt :], self.negatives[-_HELD_OUT_NEGATIVES:]
        faulty = faulty[~check(self.constraints, self.trajectory, faulty).valid]
        c = np.concatenate([held_seeds, faulty])
        return {
            "accuracy_paper": predictor.accuracy(tensor(c), torch.arange(len(c)) < len(held_seeds)),
            "accuracy_broad": predictor.accuracy(tensor(held.c), tensor(held.valid)),
        }

    def train_features(
        self, features: str, labelled: Labelled, folder: Path, seed: int, progress: Report
    ) -> dict[str, float]:
        """Train the converter to some features, save it in ``folder``, and return its held-out mean R²."""
        data, held, random = _begin(labelled, seed)
        target = tensor(getattr(data, features))
        sizes = {"width": self.settings.width, "steps": self.settings.feature_steps}
        arguments = {"features": target.shape[1], **sizes}
        converter = Converter(self.constraints.arm, self.trajectory, **arguments)
        converter.fit_standard(target)
        self._fit(converter, (tensor(data.c), converter.standardise(target)), random, progress)
        write_network(folder / f"{features}.pt", converter.state_dict(), arguments)
        explained = converter.explained(tensor(held.c), tensor(getattr(held, features)))
        return {f"r2_{features}": float(explained.mean())}

    @property
    def _learnt(self) -> int:
        """Number of seeds to learn from; the others are held out."""
        return max(1, int(len(self.seeds) * (1 - _HELD_OUT)))

    def _fit(
        self, network: Surrogate, tensors: Sequence[Tensor], random: torch.Generator, progress: Report
    ) -> None:
        batches = Shuffled(tensors, _BATCH, random)
        epochs = self.settings.epochs
        fit(network, batches, epochs, [Progress(progress, epochs * len(batches))])
        network.freeze()


def _begin(labelled: Labelled, seed: int) -> tuple[Labelled, Labelled, torch.Generator]:
    """Training data, held-out data and random numbers of a training."""
    torch.manual_seed(seed)
    random = torch.Generator().manual_seed(seed)
    order = array(torch.randperm(len(labelled.c), generator=random))
    cut = int(len(order) * (1 - _HELD_OUT))
    return labelled.take(order[:cut]), labelled.take(order[cut:]), random


def negatives_count(samples: int) -> int:
    """Number of samples to draw from a vanilla GAN: half of the labelled ones, or enough to hold some out."""
    return max(samples // 2, _LEAST_NEGATIVES + _HELD_OUT_NEGATIVES)


def load_surrogates(
    folder: Path, variant: Variant, arm: Arm, trajectory: Trajectory
) -> tuple[pl.LightningModule, pl.LightningModule]:
    """Frozen success predictor and converter of a variant with features, from their folder.

    Raises:
        ArtifactError: when one is missing, damaged, or for a different arm.
    """
    success, features = folder / "success.pt", folder / f"{variant.features}.pt"
    if variant.published is not None:
        return _load(success, PublishedPredictor), _load(features, PublishedConverter)
    predictor = _load(success, partial(SuccessPredictor, arm, trajectory))
    return predictor, _load(features, partial(Converter, arm, trajectory))


def _load(path: Path, kind: Callable[..., pl.LightningModule]) -> pl.LightningModule:
    content = read_tensors(path)
    try:
        network = kind(**content["arguments"])
        network.load_state_dict(content["weights"])
    except (LookupError, TypeError, RuntimeError) as error:
        raise ArtifactError(f"{path} does not fit this arm: {error}") from error
    network.freeze()
    return network
