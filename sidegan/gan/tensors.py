"""Tensors at the border, where other rooms pass arrays, and in files."""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from sidegan.base.arrays import Array
from sidegan.base.storage import reading, write_bytes
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


def write_tensors(path: Path, content: Any, folder: bool = True) -> None:
    """Write tensors and plain containers of them; see ``base.storage.replacing``."""
    buffer = io.BytesIO()  # in memory first: torch turns a full disk into a RuntimeError
    torch.save(content, buffer)
    write_bytes(path, buffer.getbuffer(), folder)


def write_network(path: Path, weights: Mapping[str, Tensor], arguments: Mapping[str, Any]) -> None:
    """Write a network's weights and what makes it, into a folder of work that is there."""
    write_tensors(path, {"arguments": arguments, "weights": weights}, folder=False)


def read_tensors(path: Path) -> Any:
    """Tensors and plain containers of them, on the CPU; an ArtifactError for anything else: no code runs."""
    with reading(path, "tensor"):
        return torch.load(io.BytesIO(path.read_bytes()), map_location="cpu", weights_only=True)
