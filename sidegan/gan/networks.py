"""Generator and discriminators: four full layers each, on (2, J, H) images."""

from itertools import pairwise
from typing import cast

import torch
from torch import Tensor, nn

_SMALL = 0.1  # share of the layers in the output of a generator that starts as a Gaussian
_DRAWS = 1024  # over which the layers' mean is taken


class FromNoise(nn.Module):
    """A network that makes images of noise (B, Z), uniform in [−1, 1]."""

    noise: int  # Z

    def draw(self, count: int, generator: torch.Generator | None = None) -> Tensor:
        """Noise (count, Z) on the network's device."""
        parameter = next(self.parameters())
        z = torch.rand(count, self.noise, generator=generator, dtype=parameter.dtype)
        return (2 * z - 1).to(parameter.device)

    def sample(self, count: int, generator: torch.Generator | None = None) -> Tensor:
        """Images of as much noise, (count, …)."""
        return self(self.draw(count, generator))


class Generator(FromNoise):
    """Images (B, 2, J, H) of noise (B, Z) in [−1, 1], of unit spread from the start.

    A shortcut is a linear path beside the layers (``start_from``).
    """

    def __init__(
        self, joints: int, harmonics: int, noise: int = 100, width: int = 256, shortcut: bool = False
    ) -> None:
        super().__init__()
        sizes = {"joints": joints, "harmonics": harmonics, "noise": noise, "width": width}
        self.noise, self.settings = noise, {**sizes, "shortcut": shortcut}
        self.shape, size = (2, joints, harmonics), 2 * joints * harmonics
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
        """Make a network with a shortcut yield the mean of images (N, 2, J, H), and that their covariance.

        Beside it the layers are small. Noise dimensions beyond the image's stay free for them; fewer
        than those keep the leading principal directions.
        """
        shortcut, x = cast("nn.Linear", self.shortcut), images.flatten(1).double()
        values, vectors = torch.linalg.eigh(torch.cov(x.T).reshape(x.shape[1], x.shape[1]))
        count = min(self.noise, x.shape[1])
        # Noise that is uniform on [−1, 1] has variance 1/3.
        root = vectors[:, -count:] * (3 * values[-count:].clamp_min(0)).sqrt()
        shortcut.weight.zero_()
        shortcut.weight[:, :count] = root.to(shortcut.weight)
        self._last.weight *= _SMALL
        beside = self.layers(self.draw(_DRAWS, torch.Generator().manual_seed(0)))
        shortcut.bias.copy_(x.mean(0) - beside.flatten(1).mean(0))


class Discriminator(nn.Module):
    """Logits (B,) of being an example, of images (B, 2, J, H) or of standardised features (B, p)."""

    def __init__(self, inputs: int, width: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(nn.Flatten(), *_hidden(inputs, width), nn.Linear(width, 1))

    def forward(self, x: Tensor) -> Tensor:
        """Logits (B,)."""
        return self.layers(x)[:, 0]


def _hidden(inputs: int, width: int) -> list[nn.Module]:
    """Three full layers with a ReLU after each."""
    sizes = [inputs, width, width, width]
    return [module for a, b in pairwise(sizes) for module in (nn.Linear(a, b), nn.ReLU())]
