"""Generator and discriminators as the paper's authors published them: convolutions of 7 × 7 images.

Source: as ``gan.variants``.
"""

import math
from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn

from sidegan.gan.networks import FromNoise

IMAGE = (2, 7, 7)  # shape of an image: 7 joints, and 6 harmonics with the row that repeats the first
_PADDINGS = (0, 1, 1, 0, 0)  # of the generator's layers, whose images have the sides 3, 3, 3, 5 and 7
_STRIDES = {True: (2, 2, 1, 1), False: (2, 2, 2, 1)}  # of the discriminator's layers, of images or of lists
_SLOPE = 0.2  # of the leaky ReLU below zero
_DEVIATION = 0.02  # of the weights at first


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
                nn.BatchNorm2d(outputs, track_running_stats=False),
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
    """Logits (B,) of being an example, of images (B, 2, 7, 7) or of lists of p features (B, p).

    Args:
        shape: of one example, (2, 7, 7) or (p,).
        width: channels of the first layer.
    """

    def __init__(self, shape: Sequence[int], width: int = 64) -> None:
        super().__init__()
        image = len(shape) > 1
        first, *sides = shape if image else (1, *shape, 1)
        layers: list[nn.Module] = [] if image else [nn.Unflatten(1, (first, *sides))]
        channels, strides = [first, width, 2 * width, 4 * width, 8 * width], _STRIDES[image]
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
    """The network with convolutions from N(0, 0.02), and gains of the normalisation from N(1, 0.02)."""
    for layer in network:
        if isinstance(layer, nn.Conv2d | nn.ConvTranspose2d | nn.BatchNorm2d):
            nn.init.normal_(layer.weight, float(isinstance(layer, nn.BatchNorm2d)), _DEVIATION)
    return network
