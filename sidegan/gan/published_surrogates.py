"""The published surrogates: a success predictor trained on GAN samples, and converters trained on seeds.

Source: as in ``gan.variants``.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import pytorch_lightning as pl
import torch
from torch import Tensor, nn

from sidegan.base.arrays import Array
from sidegan.base.parallel import Report
from sidegan.gan.networks import IMAGE
from sidegan.gan.tensors import read_tensors, tensor, write_network
from sidegan.gan.trainer import Progress, fit

_FIRST = 200  # channels of the first layer
_BATCH, _RATE = 100, 1e-4
_HELD_OUT = 0.2  # share of the samples and of the seeds


class ShallowNetwork(pl.LightningModule):
    """Maps images (B, 2, 7, 7) to outputs (B, n): two convolutions and a dense layer, for both surrogates.

    ``scale`` is the unit of each output: one with the authors' weights, the features' medians with ours,
    which reduces the number of training steps tenfold.
    """

    scale: Tensor

    def __init__(self, channels: int, outputs: int) -> None:
        super().__init__()
        self.register_buffer("scale", torch.ones(outputs))
        self.conv1 = nn.Conv2d(2, _FIRST, 3, 1, 1)
        self.conv2 = nn.Conv2d(_FIRST, channels, 3, 2, 1)
        self.fc2 = nn.Linear(channels * math.ceil(IMAGE[1] / 2) ** 2, outputs)

    def forward(self, image: Tensor) -> Tensor:
        """Outputs (B, n)."""
        return self.scale * self.fc2(self.conv2(self.conv1(image).relu()).relu().flatten(1))

    def configure_optimizers(self) -> torch.optim.Optimizer:
        """Adam."""
        return torch.optim.Adam(self.parameters(), _RATE, fused=True)


class PublishedPredictor(ShallowNetwork):
    """The authors' success predictor: the logit of being valid, (B, 1)."""

    def __init__(self) -> None:
        super().__init__(2, 1)

    def training_step(self, batch: list[Tensor], index: int) -> Tensor:
        """Cross entropy of labels (B,), 0-dimensional."""
        images, valid = batch
        return nn.functional.binary_cross_entropy_with_logits(self(images)[:, 0], valid.float())


class PublishedConverter(ShallowNetwork):
    """The authors' converter: features without logarithm, (B, p)."""

    def __init__(self, features: int) -> None:
        super().__init__(10, features)

    def training_step(self, batch: list[Tensor], index: int) -> Tensor:
        """Mean relative error of features (B, p), 0-dimensional."""
        images, target = batch
        return ((self(images) - target).abs() / target).mean()


@dataclass(frozen=True)
class PublishedPretraining:
    """Data for training the published surrogates."""

    steps: int  # per training
    seeds: Array  # images (N, 2, 7, 7) float32
    samples: Array  # images (M, 2, 7, 7) float32 from all epochs of a vanilla GAN
    valid: Array  # exact validity of the samples, (M,)

    def train_success(
        self, folder: Path, seed: int, weights: dict[str, Tensor] | None, progress: Report
    ) -> dict[str, float]:
        """Save the success predictor, trained or with given weights, and return its held-out accuracies.

        ``accuracy_broad`` is over held-out samples, ``accuracy_paper`` over the seeds and the faulty ones
        among these samples.
        """
        torch.manual_seed(seed)
        samples, valid = tensor(self.samples), tensor(self.valid)
        held, learnt = _split(len(valid))
        network = PublishedPredictor()
        if weights is None:
            self._fit(network, (samples[learnt], valid[learnt]), progress)
        else:
            network.load_state_dict({"scale": network.scale, **weights})
        write_network(folder / "success.pt", network.state_dict(), {})
        with torch.no_grad():
            right = (network(samples[held])[:, 0] > 0) == valid[held]
            of_seeds = network(tensor(self.seeds))[:, 0] > 0
        on_paper = torch.cat([of_seeds, right[~valid[held]]]).double().mean()
        return {"accuracy_broad": float(right.double().mean()), "accuracy_paper": float(on_paper)}

    def train_features(
        self, name: str, features: Array, folder: Path, seed: int, progress: Report
    ) -> dict[str, float]:
        """Train and save a converter to features (N, p); return its mean relative error on held-out seeds."""
        torch.manual_seed(seed)
        seeds = tensor(self.seeds)
        target = tensor(features).float()
        held, learnt = _split(len(target))
        network = PublishedConverter(target.shape[1])
        network.scale.copy_(target.median(0).values)
        self._fit(network, (seeds[learnt], target[learnt]), progress)
        write_converter(folder / f"{name}.pt", network.state_dict())
        with torch.no_grad():
            return {f"error_{name}": float(network.training_step([seeds[held], target[held]], 0))}

    def _fit(self, network: ShallowNetwork, tensors: tuple[Tensor, Tensor], progress: Report) -> None:
        """Train for ``steps`` steps, each on a new random batch."""
        count = len(tensors[0])
        batches = (torch.randperm(count)[:_BATCH] for _ in range(self.steps))
        fit(network, ([x[rows] for x in tensors] for rows in batches), 1, [Progress(progress, self.steps)])


def write_converter(path: Path, weights: dict[str, Tensor]) -> None:
    """Write a published converter for ``pretraining.load_surrogates``; the authors' weights have no scale."""
    outputs = len(weights["fc2.bias"])
    write_network(path, {"scale": torch.ones(outputs), **weights}, {"features": outputs})


def _split(count: int) -> tuple[Tensor, ...]:
    """Random rows to hold out, and the others to learn from."""
    return torch.randperm(count).tensor_split([int(_HELD_OUT * count)])


def read_weights(path: Path) -> dict[str, Tensor]:
    """The authors' weights of a surrogate, by the names of its layers."""
    return {key: x.float() for key, x in read_tensors(path).items()}
