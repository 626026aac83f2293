"""Files of what designers start from: arrays, and whom they are for."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch

from sidegan.base.storage import read_torch, write_torch
from sidegan.errors import ArtifactError

Array = np.ndarray


def write_arrays(path: Path, meta: Mapping[str, Any], arrays: Mapping[str, Array]) -> None:
    """Write arrays, and what they are for, as one file of numbers."""
    tensors = {name: torch.from_numpy(x) for name, x in arrays.items()}
    write_torch(path, {"meta": json.dumps(meta), **tensors})


def read_arrays(path: Path, meta: Mapping[str, Any], what: str) -> dict[str, Array]:
    """The arrays of a file that ``write_arrays`` wrote for the same purpose.

    Raises:
        ArtifactError: for a truncated or foreign file, or one that is for something else.
    """
    content = read_torch(path)
    try:
        found = json.loads(content.pop("meta"))
        arrays = {name: tensor.numpy() for name, tensor in content.items()}
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise ArtifactError(f"{path} does not hold {what}: {error}") from error
    if found != meta:
        raise ArtifactError(f"{path} holds {what} of {found}, expected {meta}")
    return arrays
