"""Who works on tensors: compiled kernels or plain torch; chosen here and nowhere else."""

from types import ModuleType

import torch
from torch import Tensor

from sidegan.motion import plain
from sidegan.motion.compiled import compiled
from sidegan.motion.threads import eigh


def usable(*tensors: Tensor) -> bool:
    """Whether compiled kernels take these tensors: on the processor, in float64."""
    return all(x.device.type == "cpu" and x.dtype == torch.float64 for x in tensors) and compiled()


def backend(*tensors: Tensor) -> ModuleType:
    """Module that works on these tensors: ``compiled.operations`` or, with the same functions, ``plain``."""
    if not usable(*tensors):
        return plain
    from sidegan.motion.compiled import operations

    return operations


@torch.no_grad()
def extremes(x: Tensor, low: int, high: int) -> tuple[Tensor, Tensor]:
    """The smallest and largest eigenvalues, ascending, (B, low + high), and eigenvectors (B, p, low + high).

    Not differentiable. All eigenpairs where there are no more than that.
    """
    return eigh(x) if x.shape[1] <= low + high else backend(x).extremes(x, low, high)
