"""The published surrogates: a predictor of faulty and valid samples, converters of seeds.

Source: as ``gan.variants``.
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
_HELD_OUT = 0.2  # of the samples and of the seeds


class ShallowNetwork(pl.LightningModule):
    """Outputs (B, n) of images (B, 2, 7, 7): two convolutions and a full layer, as both surrogates are.

    ``scale`` is the unit of each output: one in the authors' weights, the features' medians in ours, which
    then need a tenth of their steps.
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
    """The authors' converter: the features themselves, (B, p)."""

    def __init__(self, features: int) -> None:
        super().__init__(10, features)

    def training_step(self, batch: list[Tensor], index: int) -> Tensor:
        """Mean relative error of features (B, p), 0-dimensional."""
        images, target = batch
        return ((self(images) - target).abs() / target).mean()


@dataclass(frozen=True)
class PublishedPretraining:
    """Data from which the published surrogates learn."""

    steps: int  # of a training
    seeds: Array  # images (N, 2, 7, 7) float32
    samples: Array  # images (M, 2, 7, 7) float32 of a vanilla GAN, of all of its epochs
    valid: Array  # of the samples, by true physics, (M,)

    def train_success(
        self, folder: Path, seed: int, weights: dict[str, Tensor] | None, progress: Report
    ) -> dict[str, float]:
        """Held-out accuracies of the success predictor in ``folder``, trained or of given weights.

        ``accuracy_broad`` is over samples that it has not seen, ``accuracy_paper`` over the seeds and the
        faulty ones among these.
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
        """Mean relative error on held-out seeds of a converter to features (N, p), left in ``folder``."""
        torch.manual_seed(seed)
        seeds, target = tensor(self.seeds), tensor(features).float()
        held, learnt = _split(len(target))
        network = PublishedConverter(target.shape[1])
        network.scale.copy_(target.median(0).values)
        self._fit(network, (seeds[learnt], target[learnt]), progress)
        write_converter(folder / f"{name}.pt", network.state_dict())
        with torch.no_grad():
            return {f"error_{name}": float(network.training_step([seeds[held], target[held]], 0))}

    def _fit(self, network: ShallowNetwork, tensors: tuple[Tensor, Tensor], progress: Report) -> None:
        """So many steps, each on a batch of rows drawn anew."""
        count = len(tensors[0])
        rows = (torch.randperm(count)[:_BATCH] for _ in range(self.steps))
        fit(network, ([x[some] for x in tensors] for some in rows), 1, [Progress(progress, self.steps)])


def write_converter(path: Path, weights: dict[str, Tensor]) -> None:
    """Write a published converter, as ``pretraining.load_surrogates`` reads it; the authors' has no scale."""
    outputs = len(weights["fc2.bias"])
    write_network(path, {"scale": torch.ones(outputs), **weights}, {"features": outputs})


def _split(count: int) -> tuple[Tensor, ...]:
    """Rows that are held out, and those that are learnt from, at random."""
    return torch.randperm(count).tensor_split([int(_HELD_OUT * count)])


def read_weights(path: Path) -> dict[str, Tensor]:
    """The authors' weights of a surrogate, by the names of its layers."""
    return {key: x.float() for key, x in read_tensors(path).items()}
