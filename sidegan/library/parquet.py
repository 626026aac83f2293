"""The file of a library: one Parquet row per trajectory, the robot and its motion in the metadata."""

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor

from sidegan.base.storage import read_parquet, write_parquet
from sidegan.errors import ArtifactError

if TYPE_CHECKING:  # slow to import, and `--help` must not wait for it
    import pyarrow as pa

FORMAT = 1  # raise it when a column or a key of the metadata changes its meaning
METADATA_KEY = b"sidegan"
# Measured numbers hardly compress, and a dictionary of them only costs time.
OPTIONS: dict[str, Any] = {"compression": "none", "use_dictionary": ["source"]}
_KEYS: dict[str, type] = {
    "robot": str,
    "digest": str,
    "joints": int,
    "harmonics": int,
    "period": float,
    "home": list,
    "parameters": int,
    "margins": list,
}
_LISTS: dict[str, type] = {"home": float, "margins": str}


def write(path: Path, columns: dict[str, Tensor], source: list[str], family: dict[str, Any]) -> None:
    """Write a library's columns, (N, …) each; what is not (N,) becomes a list per row.

    Raises:
        StorageError: when the folder cannot be written or is full.
    """
    write_parquet(path, table_of(columns, source, family), **OPTIONS)


def table_of(columns: dict[str, Tensor], source: list[str], family: dict[str, Any]) -> "pa.Table":
    """What the file of a library, or a part of it, holds."""
    import pyarrow as pa

    arrays = {name: _array(x) for name, x in columns.items()}
    table = pa.table({**arrays, "source": pa.array(source, pa.string())})
    metadata = json.dumps({"format": FORMAT, **family}).encode()
    return table.replace_schema_metadata({METADATA_KEY: metadata})


def read(path: Path) -> tuple[dict[str, Tensor], list[str], dict[str, Any]]:
    """Columns, sources and metadata of a library's file.

    Raises:
        ArtifactError: when the file is missing, damaged, empty, of an unknown format, or lacks a column.
    """
    return columns_of(path, read_parquet(path))


def columns_of(path: Path, table: "pa.Table") -> tuple[dict[str, Tensor], list[str], dict[str, Any]]:
    """The same of a table, or of some of its rows, that was read from ``path``."""
    family = _family(path, table)
    if not table.num_rows:
        raise ArtifactError(f"{path} holds no trajectories")
    parameters = (family["parameters"],)
    shapes: dict[str, tuple[int, ...]] = {
        "coefficients": (family["joints"], family["harmonics"], 2),
        "valid": (),
        **{f"margin_{name}": () for name in family["margins"]},
        "fitness": (),
        "diagonal_fitness": (),
        "spectrum": parameters,
        "diagonal": parameters,
    }
    missing = [name for name in (*shapes, "source") if table.column_names.count(name) != 1]
    if missing:
        raise ArtifactError(f"{path} has no single column {', '.join(missing)}")
    columns = {name: _tensor(path, table, name, shape) for name, shape in shapes.items()}
    source = table["source"].to_pylist()
    if not all(isinstance(x, str) for x in source):
        raise ArtifactError(f"{path}: column source must hold text in every row")
    return columns, source, family


def _family(path: Path, table: "pa.Table") -> dict[str, Any]:
    stored = (table.schema.metadata or {}).get(METADATA_KEY)
    if stored is None:
        raise ArtifactError(f"{path} is a Parquet file, but not a library of sidegan")
    try:
        family = json.loads(stored)
    except ValueError as error:
        raise ArtifactError(f"{path}: the library's metadata is not JSON: {error}") from error
    if not isinstance(family, dict) or family.get("format") != FORMAT:
        found = family.get("format") if isinstance(family, dict) else family
        raise ArtifactError(f"{path} has library format {found}, this version reads format {FORMAT}")
    wrong = [key for key, kind in _KEYS.items() if not isinstance(family.get(key), kind)]
    if not wrong:
        wrong = [key for key, kind in _LISTS.items() if not all(isinstance(x, kind) for x in family[key])]
    if wrong:
        raise ArtifactError(f"{path}: the library's metadata lacks a proper {', '.join(wrong)}")
    return family


def _array(x: Tensor) -> "pa.Array":
    import pyarrow as pa

    rows = x.reshape(len(x), -1).contiguous().numpy()
    flat = pa.array(rows.reshape(-1))
    return flat if x.ndim == 1 else pa.FixedSizeListArray.from_arrays(flat, rows.shape[1])


def _tensor(path: Path, table: "pa.Table", name: str, shape: tuple[int, ...]) -> Tensor:
    """Column as a tensor, (N, *shape), whether its lists were stored with a fixed size or not."""
    import pyarrow as pa
    import pyarrow.compute as pc

    column = table[name].combine_chunks()
    kind = pa.bool_() if name == "valid" else pa.float64()
    if column.null_count:
        raise ArtifactError(f"{path}: column {name} has {column.null_count} empty cells")
    width = math.prod(shape)
    if shape:
        is_list = pa.types.is_list(column.type) or pa.types.is_large_list(column.type)
        if not is_list and not pa.types.is_fixed_size_list(column.type):
            raise ArtifactError(f"{path}: column {name} is {column.type}, expected lists of {width} numbers")
        lengths = pc.unique(pc.list_value_length(column)).to_pylist()
        if lengths != [width]:
            raise ArtifactError(f"{path}: column {name} has lists of {lengths} numbers, expected {width}")
        column = column.flatten()
    if column.type != kind or column.null_count:
        raise ArtifactError(f"{path}: column {name} holds {column.type} or empty cells, expected {kind}")
    values = np.array(column.to_numpy(zero_copy_only=False))
    return torch.from_numpy(values).reshape(len(table), *shape)
