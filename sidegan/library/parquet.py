"""The file of a library: one Parquet row per trajectory, the robot and its motion in the metadata."""

import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor

from sidegan.base.typed import Number, build
from sidegan.errors import ArtifactError, ConfigError

if TYPE_CHECKING:  # slow to import, and `--help` must not wait for it
    import pyarrow as pa

FORMAT = 1  # raise it when a column or a key of the metadata changes its meaning
METADATA_KEY = b"sidegan"
# Measured numbers hardly compress, and a dictionary of them only costs time.
OPTIONS: dict[str, Any] = {"compression": "none", "use_dictionary": ["source"]}
MARGIN = "margin_"  # begins the names of the columns of margins


@dataclass(frozen=True)
class Family:
    """Properties that all trajectories of a library share: the metadata of its file."""

    robot: str
    digest: str
    joints: int
    harmonics: int
    period: Number
    home: list[Number]
    parameters: int
    margins: list[str]

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shape of a row of every column of numbers, by name."""
        return {
            "coefficients": (self.joints, self.harmonics, 2),
            "valid": (),
            **{f"{MARGIN}{name}": () for name in self.margins},
            "fitness": (),
            "diagonal_fitness": (),
            "spectrum": (self.parameters,),
            "diagonal": (self.parameters,),
        }


def table_of(family: Family, columns: dict[str, Tensor], source: list[str]) -> "pa.Table":
    """Table of a library's columns, (N, …) each; what is not (N,) becomes a list per row."""
    import pyarrow as pa

    arrays = {name: _array(x) for name, x in columns.items()}
    table = pa.table({**arrays, "source": pa.array(source, pa.string())})
    metadata = json.dumps({"format": FORMAT, **asdict(family)}).encode()
    return table.replace_schema_metadata({METADATA_KEY: metadata})


def content_of(path: Path, table: "pa.Table") -> tuple[Family, dict[str, Tensor], list[str]]:
    """Family, columns and sources of a library's table that was read from ``path``.

    Raises:
        ArtifactError: when it is of an unknown format, or lacks a column.
    """
    family = _family(path, table)
    shapes = family.shapes()
    missing = [name for name in (*shapes, "source") if table.column_names.count(name) != 1]
    if missing:
        raise ArtifactError(f"{path} has no single column {', '.join(missing)}")
    columns = {name: _tensor(path, table, name, shape) for name, shape in shapes.items()}
    source = table["source"].to_pylist()
    if not all(isinstance(x, str) for x in source):
        raise ArtifactError(f"{path}: column source must hold text in every row")
    return family, columns, source


def _family(path: Path, table: "pa.Table") -> Family:
    stored = (table.schema.metadata or {}).get(METADATA_KEY)
    if stored is None:
        raise ArtifactError(f"{path} is a Parquet file, but not a library of sidegan")
    try:
        values = json.loads(stored)
    except ValueError as error:
        raise ArtifactError(f"{path}: the library's metadata is not JSON: {error}") from error
    number = values.pop("format", None) if isinstance(values, dict) else values
    if number != FORMAT or not isinstance(values, dict):
        raise ArtifactError(f"{path} has library format {number}, this version reads format {FORMAT}")
    try:
        return build(Family, values)
    except ConfigError as error:
        raise ArtifactError(f"{path}: the library's metadata is wrong: {error}") from error


def _array(x: Tensor) -> "pa.Array":
    import pyarrow as pa

    rows = x.reshape(len(x), math.prod(x.shape[1:])).contiguous().numpy()
    flat = pa.array(rows.reshape(-1))
    return flat if x.ndim == 1 else pa.FixedSizeListArray.from_arrays(flat, rows.shape[1])


def _tensor(path: Path, table: "pa.Table", name: str, shape: tuple[int, ...]) -> Tensor:
    """Column as a tensor, (N, *shape)."""
    import pyarrow as pa

    column, width = table[name].combine_chunks(), math.prod(shape)
    kind = pa.bool_() if name == "valid" else pa.float64()
    if shape and not (pa.types.is_fixed_size_list(column.type) and column.type.list_size == width):
        raise ArtifactError(f"{path}: column {name} is {column.type}, expected lists of {width} numbers")
    cells = column.flatten() if shape else column
    if cells.type != kind or column.null_count or cells.null_count:
        raise ArtifactError(f"{path}: column {name} holds {cells.type} or empty cells, expected {kind}")
    values = np.array(cells.to_numpy(zero_copy_only=False))
    return torch.from_numpy(values).reshape(len(table), *shape)
