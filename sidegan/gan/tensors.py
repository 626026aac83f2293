"""Conversion between tensors and arrays, and files of tensors."""

import io
import zipfile
from collections.abc import Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from sidegan.base.arrays import Array
from sidegan.base.storage import reading, write_bytes
from sidegan.base.threads import limited, threads
from sidegan.errors import ArtifactError

_ZIP = b"PK\x03\x04"  # how torch's files begin, but for those of the oldest versions

if limited():  # torch is imported inside a block of ``on_threads``
    torch.set_num_threads(threads())


def tensor(x: Array) -> Tensor:
    """A tensor with a copy of an array."""
    return torch.tensor(x)


def refusal(device: str) -> str:
    """Torch's message for an unavailable device; empty for an available one."""
    try:
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:  # an assertion fails if torch was not built for it
        return str(error).splitlines()[0]
    return ""


def random_kept() -> AbstractContextManager[None]:
    """Context after which torch's random numbers continue as if nothing had been drawn in it."""
    return torch.random.fork_rng(range(torch.cuda.device_count()))


def array(x: Tensor) -> Array:
    """A tensor as an array: floats become float64, integers and booleans keep their type."""
    x = x.detach().cpu()
    return (x.double() if x.is_floating_point() else x).numpy()


def write_tensors(path: Path, content: Any, folder: bool = True) -> None:
    """Write tensors and plain containers of them; see ``base.storage.replacing``."""
    buffer = io.BytesIO()  # in memory first: torch turns a full disk into a RuntimeError
    torch.save(content, buffer)
    write_bytes(path, buffer.getbuffer(), folder)


def write_network(path: Path, weights: Mapping[str, Tensor], arguments: Mapping[str, Any]) -> None:
    """Write a network's weights and constructor arguments into an existing work folder."""
    write_tensors(path, {"arguments": arguments, "weights": weights}, folder=False)


def read_tensors(path: Path) -> Any:
    """Tensors and plain containers of them, on the CPU; an ArtifactError for other content, never code.

    The checksums that torch writes are verified, since torch itself does not.
    """
    with reading(path, "tensor"):
        content = path.read_bytes()
        if content.startswith(_ZIP):
            with zipfile.ZipFile(io.BytesIO(content)) as file:
                if damaged := file.testzip():
                    raise ArtifactError(f"{path} is damaged: the checksum of its part {damaged} is wrong")
        return torch.load(io.BytesIO(content), map_location="cpu", weights_only=True)
