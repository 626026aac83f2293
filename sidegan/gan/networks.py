"""Generator and discriminators: four layers, ReLU, on (2, J, H) images."""

from itertools import pairwise

import torch
from torch import Tensor, nn

from sidegan.errors import ConfigError
from sidegan.gan import dcgan

BODIES = ("conv", "mlp", "dcgan")
ACTIVATIONS: dict[str, type[nn.Module]] = {"relu": nn.ReLU, "silu": nn.SiLU}
_WHISPER = 0.1  # share of the layers in the output of a generator that starts as a Gaussian
_DRAWS = 1024  # over which the layers' mean is taken


class Generator(nn.Module):
    """Images (B, 2, J, H) of noise (B, Z) in [−1, 1].

    Its body is ``mlp`` or ``conv``, of unit spread from the start, or ``dcgan``, which yields images in
    [−1, 1] (Radford, Metz, Chintala 2016); as wide as its widest layer. A shortcut is a linear path beside
    the layers (``start_from``), for which a ``dcgan`` has no room.
    """

    def __init__(
        self,
        joints: int,
        harmonics: int,
        noise: int = 100,
        body: str = "mlp",
        width: int = 256,
        shortcut: bool = False,
        activation: str = "relu",
    ) -> None:
        super().__init__()
        self.noise = noise
        self.settings = {
            "joints": joints,
            "harmonics": harmonics,
            "noise": noise,
            "body": body,
            "width": width,
            "shortcut": shortcut,
            "activation": activation,
        }
        self.shortcut = nn.Linear(noise, 2 * joints * harmonics) if shortcut else None
        if self.shortcut is not None:
            nn.init.zeros_(self.shortcut.weight)
            nn.init.zeros_(self.shortcut.bias)
        self.shape = (2, joints, harmonics)
        rows, columns = -(-joints // 2), -(-harmonics // 2)
        self.layers: nn.Sequential
        between = ACTIVATIONS[activation]
        if body == "conv":
            self.layers = nn.Sequential(
                nn.Linear(noise, width * rows * columns),
                between(),
                nn.Unflatten(1, (width, rows, columns)),
                nn.ConvTranspose2d(width, width, 4, 2, 1),
                between(),
                nn.Conv2d(width, width // 2, 3, padding=1),
                between(),
                nn.Conv2d(width // 2, 2, 3, padding=1),
            )
        elif body == "mlp":
            out = 2 * joints * harmonics
            self.layers = nn.Sequential(
                *_hidden(noise, width, 3, between), nn.Linear(width, out), nn.Unflatten(1, self.shape)
            )
        elif body == "dcgan":
            if shortcut or activation != "relu":
                raise ConfigError("a dcgan has no shortcut, and ReLU between its layers")
            self.layers = dcgan.generator_layers(joints, harmonics, noise, width)
        else:
            raise ConfigError(f"body {body!r} must be one of {', '.join(BODIES)}")
        if body != "dcgan":
            self._unit_spread()

    def forward(self, z: Tensor) -> Tensor:
        """Images (B, 2, J, H)."""
        image = self._cut(z)
        return image if self.shortcut is None else image + self.shortcut(z).view(-1, *self.shape)

    def _cut(self, z: Tensor) -> Tensor:
        """What the layers yield; those of ``conv`` round J and H up to even numbers."""
        return self.layers(z)[:, :, : self.shape[1], : self.shape[2]]

    @torch.no_grad()
    def start_from(self, images: Tensor) -> None:
        """Make the network yield the mean of ``images`` (N, 2, J, H), and its shortcut their covariance.

        The layers only whisper beside it. Noise dimensions beyond the image's stay free for them; fewer
        than those keep the leading principal directions.
        """
        if self.shortcut is None:
            raise ConfigError("a generator without a shortcut cannot start from a covariance")
        x = images.flatten(1).double()
        values, vectors = torch.linalg.eigh(torch.cov(x.T).reshape(x.shape[1], x.shape[1]))
        count = min(self.noise, x.shape[1])
        # Noise that is uniform on [−1, 1] has variance 1/3.
        root = vectors[:, -count:] * (3 * values[-count:].clamp_min(0)).sqrt()
        self.shortcut.weight.zero_()
        self.shortcut.weight[:, :count] = root.to(self.shortcut.weight)
        self._last().weight *= _WHISPER
        whisper = self._cut(self.draw(_DRAWS, torch.Generator().manual_seed(0)))
        self.shortcut.bias.copy_(x.mean(0) - whisper.flatten(1).mean(0))

    def _last(self) -> nn.Linear | nn.Conv2d:
        return [layer for layer in self.layers if isinstance(layer, (nn.Linear, nn.Conv2d))][-1]

    def draw(self, count: int, generator: torch.Generator | None = None) -> Tensor:
        """Noise (count, Z), uniform in [−1, 1], on the network's device."""
        parameter = next(self.parameters())
        z = torch.rand(count, self.noise, generator=generator, dtype=parameter.dtype)
        return (2 * z - 1).to(parameter.device)

    @torch.no_grad()
    def _unit_spread(self) -> None:
        last = self._last()
        spread = self(self.draw(256)).std(0).mean()
        last.weight /= spread
        if last.bias is not None:
            last.bias.zero_()


class Discriminator(nn.Module):
    """Logits (B,) of being an example, of whatever its layers see.

    With ``minibatch`` the mean spread of the batch is fed to the last layer (Karras et al. 2018), so
    that a generator that repeats itself is told apart.
    """

    def __init__(self, layers: list[nn.Module], width: int, minibatch: bool) -> None:
        super().__init__()
        self.layers, self.minibatch = nn.Sequential(*layers), minibatch
        self.last = nn.Linear(width + minibatch, 1)

    def forward(self, x: Tensor) -> Tensor:
        """Logits (B,)."""
        x = self.layers(x)
        if self.minibatch:
            spread = (((x - x.mean(0)) ** 2).mean(0) + 1e-8).sqrt().mean()
            x = torch.cat([x, spread.expand(len(x), 1)], 1)
        return self.last(x)[:, 0]


def image_discriminator(joints: int, harmonics: int, body: str, width: int, minibatch: bool) -> nn.Module:
    """Discriminator of images (B, 2, J, H), the paper's first; a ``dcgan`` has no minibatch feature."""
    if body == "dcgan":
        return dcgan.image_critic(joints, harmonics, width)
    if body == "mlp":
        layers = [nn.Flatten(), *_hidden(2 * joints * harmonics, width, 3)]
        return Discriminator(layers, width, minibatch)
    rows, columns = (joints + 1) // 2, (harmonics + 1) // 2
    layers = [
        nn.Conv2d(2, width // 2, 3, padding=1),
        nn.ReLU(),
        nn.Conv2d(width // 2, width, 3, 2, 1),
        nn.ReLU(),
        nn.Flatten(),
        nn.Linear(width * rows * columns, width),
        nn.ReLU(),
    ]
    return Discriminator(layers, width, minibatch)


def feature_discriminator(features: int, body: str, width: int, minibatch: bool) -> nn.Module:
    """Discriminator of standardised features (B, p), the paper's second."""
    if body == "dcgan":
        return dcgan.feature_critic(features, width)
    return Discriminator(_hidden(features, width, 3), width, minibatch)


def _hidden(inputs: int, width: int, layers: int, between: type[nn.Module] = nn.ReLU) -> list[nn.Module]:
    sizes = [inputs] + [width] * layers
    return [m for a, b in pairwise(sizes) for m in (nn.Linear(a, b), between())]
