"""What residuals say about the errors of an estimate: how large, and how much they repeat themselves."""

from collections.abc import Iterable
from typing import NamedTuple

import torch
from torch import Tensor

from sidegan.errors import ShapeError

_LAGS = 0.25  # of a chunk: longer ones have too few pairs


class Correlation(NamedTuple):
    """Autocorrelation of residuals.

    Attributes:
        inflation: 1 + 2 Σ ρ_k of each joint, at least 1, (J,): so many samples tell as much as one.
        first: ρ_1, the correlation of neighbours, (J,).
        samples: number of residuals behind it.
    """

    inflation: Tensor
    first: Tensor
    samples: int


def correlation(residuals: Iterable[Tensor]) -> Correlation:
    """Autocorrelation of residuals in pieces (S, J) without gaps.

    The sum over lags ends before the first one without a positive correlation. Where a correlation swings
    below zero later, as after a low-pass, that is too much by a tenth or so, which makes up for what the
    parameters have taken out of the residuals at the motion's own frequencies.

    Raises:
        ShapeError: when there are none.

    Source: after Geyer 1992, Practical Markov chain Monte Carlo, initial positive sequence.
    """
    products: Tensor | None = None
    pairs = torch.zeros(0, dtype=torch.float64)
    samples = 0
    for r in residuals:
        found, count = _products(r)
        products, pairs = (found, count) if products is None else (_add(products, found), _add(pairs, count))
        samples += len(r)
    if products is None:
        raise ShapeError("there are no residuals to judge by")
    rho = products / pairs.clamp_min(1)[:, None]
    rho = rho / torch.where(rho[0] > 0, rho[0], torch.ones_like(rho[0]))
    positive = (rho > 0).cumprod(0)
    times = 2 * (rho * positive)[1:].sum(0) + 1
    first = rho[1] if len(rho) > 1 else torch.zeros_like(times)
    return Correlation(times, first, samples)


def _products(r: Tensor) -> tuple[Tensor, Tensor]:
    """Sums of r_t r_{t+k} of a piece, (K, J), and how many terms each has, (K,)."""
    count = len(r)
    lags = max(1, int(_LAGS * count))
    spectrum = torch.fft.rfft(r, 2 * count, dim=0)
    found = torch.fft.irfft(spectrum.abs().square(), 2 * count, dim=0)[:lags]
    return found, torch.arange(count, count - lags, -1, dtype=torch.float64)


def _add(a: Tensor, b: Tensor) -> Tensor:
    """Sum of two tensors of which the shorter one ends with zeros."""
    if len(a) < len(b):
        a, b = b, a
    out = a.clone()
    out[: len(b)] += b
    return out
