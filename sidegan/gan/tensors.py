"""Conversion between tensors and arrays, and files of tensors."""

import ctypes
import io
import threading
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import torch
from numpy.typing import ArrayLike
from torch import Tensor, nn

from sidegan.base.arrays import Array
from sidegan.base.storage import reading, write_bytes
from sidegan.base.threads import limited, one_thread, threads
from sidegan.errors import ArtifactError

_ZIP = b"PK\x03\x04"  # how torch's files begin, but for those of the oldest versions
_training = threading.Lock()
# Of glibc [bytes]: M_TRIM_THRESHOLD, M_TOP_PAD, M_MMAP_THRESHOLD.
_MALLOC = {-1: 2**31 - 1, -2: 2**28, -3: 2**30}

if limited():  # torch is imported inside a block of ``on_threads``
    torch.set_num_threads(threads())


def constant(x: ArrayLike) -> nn.Buffer:
    """A part of a network that follows from its arguments: single precision, on its device, in no file."""
    return nn.Buffer(torch.tensor(x, dtype=torch.float32), persistent=False)


def keep_freed_memory() -> None:
    """Let the C library keep what this process frees: pages that are new for every tensor cost time.

    Nothing happens where it has no ``mallopt``.
    """
    with suppress(AttributeError, OSError):
        mallopt = ctypes.CDLL(None).mallopt
        for option, size in _MALLOC.items():
            mallopt(option, size)


@contextmanager
def torch_alone() -> Iterator[None]:
    """Context in which trainings depend on their arguments alone, as in a worker of a command.

    One at a time, since all threads of a process draw the same random numbers of torch; on one thread, in
    single precision, with gradients. Afterwards torch's random numbers continue as if none had been drawn.
    """
    with _training, one_thread(), torch.random.fork_rng(range(torch.cuda.device_count())):
        precision = torch.get_default_dtype()
        torch.set_default_dtype(torch.float32)
        try:
            with torch.inference_mode(False), torch.enable_grad():
                yield
        finally:
            torch.set_default_dtype(precision)


def numpy_array(x: Tensor) -> Array:
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
