"""The paper's surrogates: shallow convolutional networks of the coefficients, four layers each with ReLU.

They learn from the seeds and a vanilla GAN's output (Jegorova et al. 2020, section IV).
"""

import torch
from torch import Tensor, nn

from sidegan.gan.surrogates import Standard


class ShallowPredictor(nn.Module):
    """Log probability of being valid, (B,), of coefficients (B, J, H, 2): a classifier."""

    def __init__(self, joints: int, harmonics: int, width: int = 64) -> None:
        super().__init__()
        self.layers = Shallow(joints, harmonics, width, 1)

    def logits(self, c: Tensor) -> Tensor:
        """Logits (B,) of being valid."""
        return self.layers(c)[:, 0]

    def forward(self, c: Tensor) -> Tensor:
        """Log probability of being valid, (B,)."""
        return nn.functional.logsigmoid(self.logits(c))


class ShallowConverter(Standard):
    """Standardised spectrum (or diagonal) of YᵀY, (B, p), of coefficients (B, J, H, 2), without logs."""

    def __init__(self, joints: int, harmonics: int, features: int, width: int = 64) -> None:
        super().__init__(features, log=False)
        self.layers = Shallow(joints, harmonics, width, features)

    def forward(self, c: Tensor) -> Tensor:
        """Standardised features, (B, p)."""
        return self.layers(c)


class Shallow(nn.Module):
    """Outputs (B, outputs) of coefficients (B, J, H, 2): two convolutions of the image, two full layers."""

    scale: Tensor

    def __init__(self, joints: int, harmonics: int, width: int, outputs: int) -> None:
        super().__init__()
        self.register_buffer("scale", torch.ones(joints, harmonics, 2))
        rows, columns = (joints + 1) // 2, (harmonics + 1) // 2
        self.layers = nn.Sequential(
            nn.Conv2d(2, width // 2 or 1, 3, padding=1),
            nn.ReLU(),
            nn.Conv2d(width // 2 or 1, width, 3, 2, 1),
            nn.ReLU(),
            nn.Flatten(),
            nn.Linear(width * rows * columns, width),
            nn.ReLU(),
            nn.Linear(width, outputs),
        )

    @torch.no_grad()
    def fit_scale(self, seeds: Tensor) -> None:
        """Take each element's largest absolute value among the seeds (N, J, H, 2) for one."""
        self.scale.copy_(seeds.abs().amax(0).clamp_min(1e-9))

    def forward(self, c: Tensor) -> Tensor:
        """Outputs (B, outputs)."""
        return self.layers((c / self.scale).permute(0, 3, 1, 2))
