"""Who works on tensors: compiled kernels or plain torch; chosen here and nowhere else."""

from types import ModuleType

import torch
from torch import Tensor

from sidegan.motion import plain
from sidegan.motion.compiled import compiled


def usable(*tensors: Tensor) -> bool:
    """Whether compiled kernels take these tensors: on the processor, in float64."""
    return all(x.device.type == "cpu" and x.dtype == torch.float64 for x in tensors) and compiled()


def backend(*tensors: Tensor) -> ModuleType:
    """Module that works on these tensors: ``compiled.operations`` or, with the same functions, ``plain``."""
    if not usable(*tensors):
        return plain
    from sidegan.motion.compiled import operations

    return operations
