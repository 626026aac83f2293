"""The border: all other rooms pass arrays, this one tensors, which may lie on another device."""

import torch
from torch import Tensor

from sidegan.base.arrays import Array
from sidegan.base.threads import limited, threads

if limited():  # torch is first loaded within a block of ``on_threads``
    torch.set_num_threads(threads())


def tensor(x: Array) -> Tensor:
    """A tensor with the numbers of an array, which it shares with nobody."""
    return torch.tensor(x)


def refusal(device: str) -> str:
    """What torch says of a device that is not there; nothing of one that is."""
    try:
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:  # torch asserts that it was built for the device
        return str(error).splitlines()[0]
    return ""


def array(x: Tensor) -> Array:
    """The numbers of a tensor, in float64; whole numbers and truths as they are."""
    x = x.detach().cpu()
    return (x.double() if x.is_floating_point() else x).numpy()
