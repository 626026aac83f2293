"""The published recipe: networks of 7 × 7 images, and the training of surrogates.

Source: the code that accompanies Jegorova et al. 2020 (``seeding.published.REPOSITORY``).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import torch
from torch import Tensor, nn

from sidegan.base.arrays import Array
from sidegan.base.parallel import Report
from sidegan.base.storage import reading
from sidegan.gan.networks import FromNoise
from sidegan.gan.surrogates import learn, scores
from sidegan.gan.tensors import read_tensors, write_network
from sidegan.seeding.published import SCALE, Layout

IMAGE = (2, 7, 7)  # shape of a published image: 6 harmonics and a copy of the first row, 7 joints
_PADDINGS = (0, 1, 1, 0, 0)  # of the generator's layers, with output sides 3, 3, 3, 5 and 7
_STRIDES = {True: (2, 2, 1, 1), False: (2, 2, 2, 1)}  # of the discriminator's layers, for images or lists
_SLOPE = 0.2  # of the leaky ReLU below zero
_DEVIATION = 0.02  # of the initial weights
_FIRST = 200  # channels of the first layer
_BATCH, _RATE = 100, 1e-4
_HELD_OUT = 0.2  # share of the samples and of the seeds


class ConvolutionalGenerator(FromNoise):
    """Maps noise (B, Z) in [−1, 1] to images (B, 2, 7, 7) in [−1, 1].

    Batches are normalised by their own statistics, also when sampling.
    """

    def __init__(self, noise: int = 100, width: int = 64, batch: int = 100) -> None:
        super().__init__()
        self.noise, self.batch = noise, batch
        self.settings = {"noise": noise, "width": width, "batch": batch}
        channels = [noise, 8 * width, 4 * width, 2 * width, width, 2]
        layers: list[nn.Module] = [nn.Unflatten(1, (noise, 1, 1))]
        for (inputs, outputs), padding in zip(pairwise(channels), _PADDINGS, strict=True):
            layers += [
                nn.ConvTranspose2d(inputs, outputs, 3, 1, padding, bias=False),
                nn.BatchNorm2d(outputs, track_running_stats=False),
                nn.ReLU(),
            ]
        self.layers = _initialised(nn.Sequential(*layers[:-2], nn.Tanh()))

    def sample(self, count: int, stream: torch.Generator | None = None) -> Tensor:
        """Images (count, 2, 7, 7), drawn in whole batches of the training's size."""
        batches = [self(self.draw(self.batch, stream)) for _ in range(-(-count // self.batch))]
        return torch.cat(batches)[:count]


class _ListConvolution(nn.Conv2d):
    """A convolution of images (B, C, p, 1); all but the kernel's middle column sees padding alone."""

    def forward(self, x: Tensor) -> Tensor:
        """Channels (B, C', p', 1)."""
        stride, padding = self.stride[0], self.kernel_size[0] // 2
        return nn.functional.conv1d(x[..., 0], self.weight[..., padding], None, stride, padding)[..., None]


class ConvolutionalDiscriminator(nn.Module):
    """Logits (B,) of being an example of a shape, images (B, 2, 7, 7) or features (B, p)."""

    def __init__(self, shape: Sequence[int], width: int) -> None:
        super().__init__()
        image = len(shape) > 1
        first, *sides = shape if image else (1, *shape, 1)
        layers: list[nn.Module] = [] if image else [nn.Unflatten(1, (first, *sides))]
        channels = [first, width, 2 * width, 4 * width, 8 * width]
        strides = _STRIDES[image]
        convolution = nn.Conv2d if image else _ListConvolution
        for index, ((inputs, outputs), stride) in enumerate(zip(pairwise(channels), strides, strict=True)):
            layers.append(convolution(inputs, outputs, 3, stride, 1, bias=False))
            if index:
                layers.append(nn.BatchNorm2d(outputs, track_running_stats=False))
            layers.append(nn.LeakyReLU(_SLOPE))
            sides = [-(-side // stride) for side in sides]
        layers += [nn.Flatten(), nn.Linear(channels[-1] * math.prod(sides), 1), nn.Flatten(0)]
        self.layers = _initialised(nn.Sequential(*layers))

    def forward(self, x: Tensor) -> Tensor:
        """Logits (B,)."""
        return self.layers(x)


def _initialised(network: nn.Sequential) -> nn.Sequential:
    """The network with convolutions drawn from N(0, 0.02) and normalisation gains from N(1, 0.02)."""
    for layer in network:
        if isinstance(layer, nn.Conv2d | nn.ConvTranspose2d | nn.BatchNorm2d):
            nn.init.normal_(layer.weight, float(isinstance(layer, nn.BatchNorm2d)), _DEVIATION)
    return network


class PublishedScaling(Layout):
    """A differentiable ``Layout``."""

    def image(self, c: Tensor) -> Tensor:
        """Images (B, 2, H + 1, J) float32 from coefficients (B, J, H, 2)."""
        rows = SCALE * c.permute(0, 3, 1, 2).reshape(len(c), 2, self.harmonics, self.joints)
        return torch.cat([rows, rows[:, :, :1]], 2).float()  # keeps the layout in memory, by which sums round


class ShallowNetwork(nn.Module):
    """Maps images (B, 2, 7, 7) to outputs (B, n): two convolutions and a dense layer, for both surrogates.

    ``scale`` is the unit of each output: the features' medians in a converter that is trained here, which
    reduces the number of training steps tenfold, and else one.
    """

    def __init__(self, channels: int, outputs: int) -> None:
        super().__init__()
        self.scale = nn.Buffer(torch.ones(outputs))
        self.conv1 = nn.Conv2d(2, _FIRST, 3, 1, 1)
        self.conv2 = nn.Conv2d(_FIRST, channels, 3, 2, 1)
        self.fc2 = nn.Linear(channels * math.ceil(IMAGE[1] / 2) ** 2, outputs)

    def forward(self, image: Tensor) -> Tensor:
        """Outputs (B, n)."""
        return self.scale * self.fc2(self.conv2(self.conv1(image).relu()).relu().flatten(1))


class PublishedPredictor(ShallowNetwork):
    """The authors' success predictor: the logit of being valid, (B, 1)."""

    def __init__(self) -> None:
        super().__init__(2, 1)

    def accepts(self, images: Tensor) -> Tensor:
        """Whether trajectories are predicted to be valid, (B,)."""
        return self(images)[:, 0] > 0

    def loss(self, images: Tensor, valid: Tensor) -> Tensor:
        """Cross entropy of labels (B,), 0-dimensional."""
        return nn.functional.binary_cross_entropy_with_logits(self(images)[:, 0], valid.float())


class PublishedConverter(ShallowNetwork):
    """The authors' converter: features without logarithm, (B, p)."""

    def __init__(self, features: int) -> None:
        super().__init__(10, features)

    def loss(self, images: Tensor, target: Tensor) -> Tensor:
        """Mean relative error of features (B, p), 0-dimensional."""
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
        """Save the success predictor, trained or with given weights, and return its held-out scores.

        Those of ``surrogates.scores``, on the seeds and held-out samples.
        """
        torch.manual_seed(seed)
        held, learnt = _split(len(self.valid))
        network = PublishedPredictor()
        if weights is None:
            self._fit(network, torch.tensor(self.samples)[learnt], torch.tensor(self.valid)[learnt], progress)
        else:
            network.load_state_dict(weights)
        write_network(folder / "success.pt", network.state_dict(), {})
        samples, valid = self.samples[held.numpy()], self.valid[held.numpy()]
        return scores(network.accepts, self.seeds, samples[~valid], samples, valid)

    def train_features(
        self, name: str, features: Array, folder: Path, seed: int, progress: Report
    ) -> dict[str, float]:
        """Train and save a converter to features (N, p); return its mean relative error on held-out seeds."""
        torch.manual_seed(seed)
        seeds, target = torch.tensor(self.seeds), torch.tensor(features).float()
        held, learnt = _split(len(target))
        network = PublishedConverter(target.shape[1])
        network.scale.copy_(target.median(0).values)
        self._fit(network, seeds[learnt], target[learnt], progress)
        write_converter(folder / f"{name}.pt", network.state_dict())
        with torch.no_grad():
            return {f"error_{name}": float(network.loss(seeds[held], target[held]))}

    def _fit(
        self, network: PublishedPredictor | PublishedConverter, x: Tensor, target: Tensor, progress: Report
    ) -> None:
        """Train for ``steps`` steps, each on a new random batch."""
        batches = (torch.randperm(len(x))[:_BATCH] for _ in range(self.steps))
        losses = (network.loss(x[rows], target[rows]) for rows in batches)
        learn(losses, self.steps, torch.optim.Adam(network.parameters(), _RATE, fused=True), progress)


def write_converter(path: Path, weights: dict[str, Tensor]) -> None:
    """Write a published converter for ``pretraining.load_surrogates``."""
    write_network(path, weights, {"features": len(weights["scale"])})


def _split(count: int) -> tuple[Tensor, ...]:
    """Random rows to hold out, and the others to learn from."""
    return torch.randperm(count).tensor_split([int(_HELD_OUT * count)])


def read_weights(path: Path) -> dict[str, Tensor]:
    """The authors' weights of a surrogate, by the names of its layers, and a scale of one.

    Raises:
        ArtifactError: for a missing, damaged or foreign file.
    """
    with reading(path, "surrogate"):
        weights = {key: x.float() for key, x in read_tensors(path).items()}
        weights = {"scale": torch.ones(len(weights["fc2.bias"])), **weights}
        ShallowNetwork(len(weights["conv2.bias"]), len(weights["scale"])).load_state_dict(weights)
    return weights
