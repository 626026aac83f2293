"""Eigenpairs at both ends of the spectra of many small symmetric matrices."""

import torch
from torch import Tensor

from sidegan.motion.backend import backend
from sidegan.motion.threads import eigh


@torch.no_grad()
def extremes(x: Tensor, low: int, high: int) -> tuple[Tensor, Tensor]:
    """The smallest and largest eigenvalues, ascending, (B, low + high), and eigenvectors (B, p, low + high).

    Not differentiable. All eigenpairs where there are no more than that.
    """
    return eigh(x) if x.shape[1] <= low + high else backend(x).extremes(x, low, high)
