"""Files of tensors: the weights of networks, and what a training leaves to go on from."""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from sidegan.base.storage import reading, write_bytes
from sidegan.errors import ArtifactError


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


def readable_tensors(path: Path) -> bool:
    """Whether a file of tensors is there and whole: what a resumed run needs not make again."""
    try:
        read_tensors(path)
    except ArtifactError:
        return False
    return True
