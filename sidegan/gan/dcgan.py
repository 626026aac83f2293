"""A DCGAN's layers for (2, J, H) images, as its authors describe them (Radford, Metz, Chintala 2016).

Strides in place of pooling and no hidden fully connected layers; batch normalisation but for the generator's
last and the discriminators' first and last layers; ReLU in the generator, leaky ReLU in the discriminators;
tanh at the generator's end; weights from N(0, 0.02). Four layers each, as in Jegorova et al. 2020.
"""

from itertools import pairwise

from torch import nn

from sidegan.gan.convolution import SmallConv2d, SmallConvTranspose2d

_SLOPE = 0.2  # of the leaky ReLU below zero
_DEVIATION = 0.02  # of the weights
_LAYERS = 4


def generator_layers(joints: int, harmonics: int, noise: int, width: int) -> nn.Sequential:
    """Images (B, 2, J, H) in [−1, 1] of noise (B, Z); ``width`` channels after the first layer.

    The first layer projects the noise, each of the others doubles the image's sides.
    """
    rows, columns = _sides(joints), _sides(harmonics)
    channels = [noise, *_halved(width)]
    layers: list[nn.Module] = [nn.Unflatten(1, (noise, 1, 1))]
    for i, (inputs, outputs) in enumerate(pairwise(channels)):
        if i == 0:
            layers.append(SmallConvTranspose2d(inputs, outputs, (rows[0], columns[0]), bias=False))
        else:
            kernel = (_kernel(rows[i]), _kernel(columns[i]))
            layers.append(SmallConvTranspose2d(inputs, outputs, kernel, 2, 1, bias=False))
        layers += [nn.BatchNorm2d(outputs), nn.ReLU()]
    last = SmallConvTranspose2d(channels[-1], 2, (_kernel(joints), _kernel(harmonics)), 2, 1)
    return initialised(nn.Sequential(*layers, last, nn.Tanh()))


def image_critic(joints: int, harmonics: int, width: int) -> nn.Sequential:
    """Logits (B,) of images (B, 2, J, H): the generator's layers backwards."""
    rows, columns = _sides(joints), _sides(harmonics)
    channels = [2, *reversed(_halved(width))]
    layers: list[nn.Module] = []
    for i, (inputs, outputs) in enumerate(pairwise(channels)):
        kernel = (_kernel(rows[-1 - i]), _kernel(columns[-1 - i]))
        layers.append(SmallConv2d(inputs, outputs, kernel, 2, 1, bias=i == 0))
        layers += [nn.BatchNorm2d(outputs), nn.LeakyReLU(_SLOPE)] if i else [nn.LeakyReLU(_SLOPE)]
    last = SmallConv2d(channels[-1], 1, (rows[0], columns[0]))
    return initialised(nn.Sequential(*layers, last, nn.Flatten(0)))


def feature_critic(features: int, width: int) -> nn.Sequential:
    """Logits (B,) of standardised features (B, p); a list has no neighbours, so its layers are full."""
    layers: list[nn.Module] = [nn.Linear(features, width), nn.LeakyReLU(_SLOPE)]
    for _ in range(_LAYERS - 2):
        layers += [nn.Linear(width, width, bias=False), nn.BatchNorm1d(width), nn.LeakyReLU(_SLOPE)]
    return initialised(nn.Sequential(*layers, nn.Linear(width, 1), nn.Flatten(0)))


def initialised(network: nn.Sequential) -> nn.Sequential:
    """The network with weights from N(0, 0.02), gains of batch normalisation from N(1, 0.02), biases 0."""
    for layer in network:
        gain = isinstance(layer, (nn.BatchNorm1d, nn.BatchNorm2d))
        for name, parameter in layer.named_parameters():
            if name == "weight":
                nn.init.normal_(parameter, float(gain), _DEVIATION)
            else:
                nn.init.zeros_(parameter)
    return network


def _halved(width: int) -> list[int]:
    """Channels of the generator's images between its layers."""
    return [max(1, width >> i) for i in range(_LAYERS - 1)]


def _sides(length: int) -> list[int]:
    """A side of the images between layers and of the last, from the smallest on."""
    sides = [length]
    for _ in range(_LAYERS - 1):
        sides.insert(0, -(-sides[0] // 2))
    return sides


def _kernel(side: int) -> int:
    """Kernel of a convolution of stride 2 and padding 1 between a side and half of it, rounded up."""
    return 3 if side % 2 else 4
