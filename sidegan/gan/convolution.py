"""Convolutions of small images as products of matrices: what torch's give, trained several times as fast.

A DCGAN's images are of 7 × 5, 4 × 3 and 2 × 2, of which a kernel of 4 × 4 covers most: a full matrix loses
little, and torch's kernels need ten times as long for the gradient as for the images.
"""

from functools import lru_cache

import torch
from torch import Tensor, nn

Pair = tuple[int, ...]


class SmallConv2d(nn.Conv2d):
    """``nn.Conv2d`` of small images: with a stride and a padding in numbers, and nothing else."""

    def forward(self, input: Tensor) -> Tensor:
        """Images (B, O, H', W') of images (B, I, H, W)."""
        steps, large = _steps(self), tuple(input.shape[2:])
        small = tuple((side + 2 * pad - k) // by + 1 for side, k, by, pad in zip(large, *steps, strict=True))
        taps = _taps(small, large, *steps, input.device).transpose(1, 2)
        return _product(self.bias, self.weight.transpose(0, 1), taps, input, small)


class SmallConvTranspose2d(nn.ConvTranspose2d):
    """``nn.ConvTranspose2d`` of small images: with a stride and a padding, and nothing else."""

    def forward(self, input: Tensor, output_size: list[int] | None = None) -> Tensor:
        """Images (B, O, H', W') of images (B, I, H, W)."""
        steps, small = _steps(self), tuple(input.shape[2:])
        large = tuple((side - 1) * by - 2 * pad + k for side, k, by, pad in zip(small, *steps, strict=True))
        return _product(self.bias, self.weight, _taps(small, large, *steps, input.device), input, large)


def _steps(layer: nn.Conv2d | nn.ConvTranspose2d) -> tuple[Pair, Pair, Pair]:
    """Kernel's sides, stride and padding."""
    if isinstance(layer.padding, str):
        raise TypeError(f"padding is two numbers here, got {layer.padding!r}")
    return layer.kernel_size, layer.stride, layer.padding


def _product(bias: Tensor | None, weight: Tensor, taps: Tensor, x: Tensor, size: Pair) -> Tensor:
    """Images (B, O, *size) of images x, by weights (I, O, *kernel) and taps (K, positions, new positions)."""
    (inputs, outputs), (kernel, positions, _) = weight.shape[:2], taps.shape
    spread = weight.reshape(inputs * outputs, kernel) @ taps.reshape(kernel, -1).to(weight)
    matrix = spread.view(inputs, outputs, positions, -1).transpose(1, 2).reshape(inputs * positions, -1)
    y = (x.flatten(1) @ matrix).unflatten(1, (outputs, *size))
    return y if bias is None else y + bias[:, None, None]


@lru_cache(maxsize=64)
def _taps(small: Pair, large: Pair, kernel: Pair, stride: Pair, pad: Pair, device: torch.device) -> Tensor:
    """1 where a tap of the kernel joins a position of the small image with one of the large, (K, S, L)."""
    joined = []
    for side in range(2):
        tap, near, far = (torch.arange(n, device=device) for n in (kernel[side], small[side], large[side]))
        reached = tap[:, None] - pad[side] + stride[side] * near
        joined.append((reached[:, :, None] == far).float())
    return torch.einsum("kab,lcd->klacbd", *joined).reshape(
        kernel[0] * kernel[1], small[0] * small[1], large[0] * large[1]
    )
