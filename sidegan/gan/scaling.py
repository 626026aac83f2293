"""Maps between coefficients and the networks' images."""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from sidegan.errors import ShapeError
from sidegan.seeding.published import SCALE, Layout

_SHRINKAGE = 1e-3  # share of the mean variance added to each covariance, which few seeds leave singular


class Scaling(nn.Module):
    """Images of unit spread: centred and whitened coefficients of each joint.

    Args:
        mean: mean coefficients [rad/s], (J, 2 H).
        spread: maps a joint's image to its coefficients, (J, 2 H, 2 H).
    """

    mean: Tensor
    spread: Tensor

    def __init__(self, mean: Tensor, spread: Tensor) -> None:
        super().__init__()
        self.register_buffer("mean", mean)
        self.register_buffer("spread", spread)

    @staticmethod
    def fit(c: Tensor) -> "Scaling":
        """Scaling that whitens each joint's 2 H coefficients in a seed set (N, J, H, 2)."""
        if len(c) < 2:
            raise ShapeError(f"scaling needs at least two seeds, got {len(c)}")
        x = c.flatten(2).double().transpose(0, 1)
        mean = x.mean(1)
        centred = x - mean[:, None]
        covariance = centred.transpose(1, 2) @ centred / (x.shape[1] - 1)
        floor = _SHRINKAGE * covariance.diagonal(dim1=1, dim2=2).mean(1).clamp_min(1e-12)
        eye = torch.eye(x.shape[2], dtype=torch.float64)
        values, vectors = torch.linalg.eigh(covariance + floor[:, None, None] * eye)
        return Scaling(mean, vectors @ torch.diag_embed(values.sqrt()) @ vectors.transpose(1, 2))

    def coefficients(self, image: Tensor) -> Tensor:
        """Coefficients [rad/s], (B, J, H, 2), from images (B, 2, J, H)."""
        x = image.permute(0, 2, 3, 1).flatten(2)
        c = torch.einsum("bjk,jlk->bjl", x, self.spread) + self.mean
        return c.reshape(*c.shape[:2], -1, 2)

    def image(self, c: Tensor) -> Tensor:
        """Images (B, 2, J, H) from coefficients (B, J, H, 2)."""
        x = (c.to(self.mean).flatten(2) - self.mean).transpose(0, 1)
        whitened = torch.linalg.solve(self.spread, x.transpose(1, 2)).permute(2, 0, 1)
        return whitened.reshape(c.shape).permute(0, 3, 1, 2)


@dataclass(frozen=True)
class PublishedScaling:
    """The images of the paper's authors: a differentiable ``Layout``."""

    layout: Layout

    def coefficients(self, image: Tensor) -> Tensor:
        """Coefficients [rad/s], (B, J, H, 2), from images (B, 2, H + 1, J)."""
        rows = image[:, :, :-1].reshape(len(image), 2, self.layout.joints, self.layout.harmonics)
        return rows.permute(0, 2, 3, 1) / SCALE

    def image(self, c: Tensor) -> Tensor:
        """Images (B, 2, H + 1, J) float32 from coefficients (B, J, H, 2)."""
        rows = SCALE * c.permute(0, 3, 1, 2).reshape(len(c), 2, self.layout.harmonics, self.layout.joints)
        return torch.cat([rows, rows[:, :, :1]], 2).float()
