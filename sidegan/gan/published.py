"""The recipe as the paper's authors published it: convolutions of 7 × 7 images, losses, surrogates.

Written by the facts of the code that accompanies Jegorova et al. 2020 (``seeds.published.REPOSITORY``), where
that and the text differ by the code. Differences are told beside what they change.
"""

import math
from itertools import pairwise

import torch
from torch import Tensor, nn

from sidegan.gan.networks import FromNoise
from sidegan.gan.terms import Adversary, Batch, Formula, LossTerm
from sidegan.gan.variants import Variant
from sidegan.seeds.published import Layout

IMAGE = (2, 7, 7)  # shape of an image: 7 joints, and 6 harmonics with the row that repeats the first
_PADDINGS = (0, 1, 1, 0, 0)  # of the generator's layers, whose images have the sides 3, 3, 3, 5 and 7
_STRIDES = {"image": (2, 2, 1, 1), "list": (2, 2, 2, 1)}  # of the discriminators' layers
_SLOPE = 0.2  # of the leaky ReLU below zero
_DEVIATION = 0.02  # of the weights at first
_FIRST = 200  # channels of a surrogate's first layer
_GROWTH = 0.06  # of the weight of success, per epoch from that on in which fitness counts
_TINY = 1e-12


class ConvolutionalGenerator(FromNoise):
    """Images (B, 2, 7, 7) in [−1, 1] of noise (B, Z) in [−1, 1].

    Batches are normalised by their own statistics, when sampling too.
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
                *_normalised(outputs),
                nn.ReLU(),
            ]
        self.layers = _initialised(nn.Sequential(*layers[:-2], nn.Tanh()))

    def forward(self, z: Tensor) -> Tensor:
        """Images (B, 2, 7, 7)."""
        return self.layers(z)

    def sample(self, count: int, generator: torch.Generator | None = None) -> Tensor:
        """Images (count, 2, 7, 7), drawn in whole batches of the size of the training's."""
        batches = [self(self.draw(self.batch, generator)) for _ in range(-(-count // self.batch))]
        return torch.cat(batches)[:count]


class ConvolutionalDiscriminator(nn.Module):
    """Logits (B,) of being an example, of images (B, 2, 7, 7), or of lists of p features (B, p)."""

    def __init__(self, features: int | None = None, width: int = 64) -> None:
        super().__init__()
        strides = _STRIDES["image" if features is None else "list"]
        channels = [2 if features is None else 1, width, 2 * width, 4 * width, 8 * width]
        sides = [IMAGE[1], IMAGE[1]] if features is None else [features, 1]
        layers: list[nn.Module] = [] if features is None else [nn.Unflatten(1, (1, features, 1))]
        for index, ((inputs, outputs), stride) in enumerate(zip(pairwise(channels), strides, strict=True)):
            layers.append(nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False))
            layers += [*(_normalised(outputs) if index else []), nn.LeakyReLU(_SLOPE)]
            sides = [-(-side // stride) for side in sides]
        layers += [nn.Flatten(), nn.Linear(channels[-1] * math.prod(sides), 1), nn.Flatten(0)]
        self.layers = _initialised(nn.Sequential(*layers))

    def forward(self, x: Tensor) -> Tensor:
        """Logits (B,)."""
        return self.layers(x)


class ShallowNetwork(nn.Module):
    """Outputs (B, n) of images (B, 2, 7, 7): two convolutions and a full layer, as both surrogates are.

    The success predictor has two channels after the second and one output, the logit of being valid; the
    converter has ten and yields the features themselves. ``scale`` is the unit of each output: one in the
    authors' weights, the features' medians in ours, which then need a tenth of their steps.
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


def predictor_network() -> ShallowNetwork:
    """An untrained success predictor."""
    return ShallowNetwork(2, 1)


def converter_network(features: int) -> ShallowNetwork:
    """An untrained converter to so many features."""
    return ShallowNetwork(10, features)


class PublishedSampler(nn.Module):
    """Batches of a generator of published images; what ``gan.terms.Sampler`` is to the others."""

    limits = None

    def __init__(self, network: ConvolutionalGenerator, layout: Layout, features: nn.Module | None) -> None:
        super().__init__()
        self.network, self.scaling, self.features = network, layout, features

    def forward(self, count: int, random: torch.Generator | None = None) -> Batch:
        """So many trajectories."""
        images = self.network.sample(count, random)
        features = self.features
        seen = None if features is None else lambda _: features(images)
        return Batch(self.scaling.coefficients(images), lambda: images, seen)


class GrowingSuccess(LossTerm):
    """One minus the mean probability of being valid; its weight grows from the first epoch of fitness on."""

    def __init__(self, weight: float, network: nn.Module, start: int) -> None:
        super().__init__(weight)
        self.network, self.grows_from = network, start

    def weight_at(self, epoch: int, eased: float) -> float:
        """Weight in an epoch."""
        return self.weight * (1 + _GROWTH * max(0, epoch - self.grows_from))

    def forward(self, batch: Batch) -> Tensor:
        """Loss, 0-dimensional."""
        return 1 - self.network(batch.images).sigmoid().mean()


def fitness_loss(features: Tensor, kind: str) -> Tensor:
    """What the fitness loss makes small of predicted features (B, p), 0-dimensional; see ``Published``."""
    x = features.clamp_min(_TINY)
    if kind == "ratio":
        return (x.amax(1) / x.amin(1)).mean()
    share = x / x.sum(1, keepdim=True)
    entropy = -(share * share.log()).sum(1).mean()
    return entropy if kind == "entropy" else -entropy


def published_terms(
    variant: Variant, sampler: PublishedSampler, seeds: Tensor, success: nn.Module | None
) -> list[LossTerm]:
    """Loss terms of a variant, for seeds (N, J, H, 2) [rad/s].

    The second discriminator's examples are what the converter says of the seeds, not their true features.
    """
    weights, images = variant.weights, sampler.scaling.image(seeds).float()
    critic = ConvolutionalDiscriminator(width=variant.width)
    terms: list[LossTerm] = [Adversary(weights.adversarial, critic, images, lambda batch: batch.images)]
    if success is not None:
        terms.append(GrowingSuccess(weights.success, success, variant.fitness_start))
    if sampler.features is not None and variant.published is not None:
        with torch.no_grad():
            features = sampler.features(images)
        critic, kind = ConvolutionalDiscriminator(features.shape[1], variant.width), variant.published.fitness
        terms.append(Adversary(weights.features, critic, features, lambda batch: batch.features))

        def fitness(batch: Batch) -> Tensor:
            return fitness_loss(batch.features, kind)

        terms.append(Formula(weights.fitness, fitness, start=variant.fitness_start))
    return terms


def _normalised(channels: int) -> list[nn.Module]:
    """Normalisation by the statistics of the batch at hand, never by those of a training."""
    return [nn.BatchNorm2d(channels, track_running_stats=False)]


def _initialised(network: nn.Sequential) -> nn.Sequential:
    """The network with convolutions from N(0, 0.02), and gains of the normalisation from N(1, 0.02)."""
    for layer in network:
        if isinstance(layer, nn.Conv2d | nn.ConvTranspose2d | nn.BatchNorm2d):
            nn.init.normal_(layer.weight, float(isinstance(layer, nn.BatchNorm2d)), _DEVIATION)
    return network
