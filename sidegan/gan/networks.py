"""Generator and discriminators: ours, four dense layers on (2, J, H) images; and the published ones.

The latter are convolutions of 7 × 7 images; source: as in ``gan.variants``.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import cast

import torch
from torch import Tensor, nn

_SMALL = 0.1  # initial scale of the layers next to the shortcut
_DRAWS = 1024  # samples for the layers' mean

IMAGE = (2, 7, 7)  # shape of a published image: 6 harmonics and a copy of the first row, 7 joints
_PADDINGS = (0, 1, 1, 0, 0)  # of the generator's layers, with output sides 3, 3, 3, 5 and 7
_STRIDES = {True: (2, 2, 1, 1), False: (2, 2, 2, 1)}  # of the discriminator's layers, for images or lists
_SLOPE = 0.2  # of the leaky ReLU below zero
_DEVIATION = 0.02  # of the initial weights


class FromNoise(nn.Module):
    """A network that maps noise (B, Z), uniform in [−1, 1], to images."""

    noise: int  # Z

    def draw(self, count: int, generator: torch.Generator | None = None) -> Tensor:
        """Noise (count, Z) on the network's device."""
        parameter = next(self.parameters())
        z = torch.rand(count, self.noise, generator=generator, dtype=parameter.dtype)
        return (2 * z - 1).to(parameter.device)

    def sample(self, count: int, generator: torch.Generator | None = None) -> Tensor:
        """Images of new noise, (count, …)."""
        return self(self.draw(count, generator))


class Generator(FromNoise):
    """Maps noise (B, Z) in [−1, 1] to images (B, 2, J, H), initially of unit spread.

    A shortcut is a linear path parallel to the layers (``start_from``).
    """

    def __init__(
        self, joints: int, harmonics: int, noise: int = 100, width: int = 256, shortcut: bool = False
    ) -> None:
        super().__init__()
        sizes = {"joints": joints, "harmonics": harmonics, "noise": noise, "width": width}
        self.noise = noise
        self.settings = {**sizes, "shortcut": shortcut}
        self.shape = (2, joints, harmonics)
        size = 2 * joints * harmonics
        self.shortcut = nn.Linear(noise, size) if shortcut else None
        if self.shortcut is not None:
            nn.init.zeros_(self.shortcut.weight)
            nn.init.zeros_(self.shortcut.bias)
        self.layers = nn.Sequential(
            *_hidden(noise, width), nn.Linear(width, size), nn.Unflatten(1, self.shape)
        )
        with torch.no_grad():
            self._last.weight /= self(self.draw(256)).std(0).mean()
            self._last.bias.zero_()

    @property
    def _last(self) -> nn.Linear:
        return cast("nn.Linear", self.layers[-2])

    def forward(self, z: Tensor) -> Tensor:
        """Images (B, 2, J, H)."""
        image = self.layers(z)
        return image if self.shortcut is None else image + self.shortcut(z).view(-1, *self.shape)

    @torch.no_grad()
    def start_from(self, images: Tensor) -> None:
        """Initialise a network with a shortcut to the mean and covariance of images (N, 2, J, H).

        The layers' output becomes small. Noise dimensions beyond the image's only enter the layers; with
        fewer dimensions, the shortcut keeps the leading principal directions.
        """
        shortcut = cast("nn.Linear", self.shortcut)
        x = images.flatten(1).double()
        values, vectors = torch.linalg.eigh(torch.cov(x.T).reshape(x.shape[1], x.shape[1]))
        count = min(self.noise, x.shape[1])
        # Noise that is uniform on [−1, 1] has variance 1/3.
        root = vectors[:, -count:] * (3 * values[-count:].clamp_min(0)).sqrt()
        shortcut.weight.zero_()
        shortcut.weight[:, :count] = root.to(shortcut.weight)
        self._last.weight *= _SMALL
        output = self.layers(self.draw(_DRAWS, torch.Generator().manual_seed(0)))
        shortcut.bias.copy_(x.mean(0) - output.flatten(1).mean(0))


class Discriminator(nn.Module):
    """Logits (B,) of being an example, for images (B, 2, J, H) or standardised features (B, p)."""

    def __init__(self, inputs: int, width: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(nn.Flatten(), *_hidden(inputs, width), nn.Linear(width, 1))

    def forward(self, x: Tensor) -> Tensor:
        """Logits (B,)."""
        return self.layers(x)[:, 0]


def _hidden(inputs: int, width: int) -> list[nn.Module]:
    """Three dense layers, each with a ReLU."""
    sizes = [inputs, width, width, width]
    return [module for a, b in pairwise(sizes) for module in (nn.Linear(a, b), nn.ReLU())]


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

    def forward(self, z: Tensor) -> Tensor:
        """Images (B, 2, 7, 7)."""
        return self.layers(z)

    def sample(self, count: int, generator: torch.Generator | None = None) -> Tensor:
        """Images (count, 2, 7, 7), drawn in whole batches of the training's size."""
        batches = [self(self.draw(self.batch, generator)) for _ in range(-(-count // self.batch))]
        return torch.cat(batches)[:count]


class ConvolutionalDiscriminator(nn.Module):
    """Logits (B,) of being an example, for images (B, 2, 7, 7) or features (B, p).

    Args:
        shape: of an example, (2, 7, 7) or (p,).
        width: channels of the first layer.
    """

    def __init__(self, shape: Sequence[int], width: int = 64) -> None:
        super().__init__()
        image = len(shape) > 1
        first, *sides = shape if image else (1, *shape, 1)
        layers: list[nn.Module] = [] if image else [nn.Unflatten(1, (first, *sides))]
        channels = [first, width, 2 * width, 4 * width, 8 * width]
        strides = _STRIDES[image]
        for index, ((inputs, outputs), stride) in enumerate(zip(pairwise(channels), strides, strict=True)):
            layers.append(nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False))
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
