"""The file of a library: a Parquet row per trajectory, with the arm and the family in the metadata."""

import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.storage import reading
from sidegan.base.typed import Number, Positive, build
from sidegan.errors import ArtifactError, ConfigError

if TYPE_CHECKING:  # too slow to import for `--help`
    import pyarrow as pa

FORMAT = 1  # raise it when a column or a key of the metadata changes its meaning
METADATA_KEY = b"sidegan"
# Measured numbers hardly compress, and a dictionary of them only costs time. Reading and writing need a row
# group in memory in addition to the library: 70 MB at seven joints.
OPTIONS: dict[str, Any] = {"compression": "none", "use_dictionary": ["source"], "row_group_size": 50_000}
MARGIN = "margin_"  # prefix of columns of margins


@dataclass(frozen=True)
class Family:
    """Properties that all trajectories of a library share: the metadata of its file."""

    robot: str
    digest: str
    joints: int
    harmonics: int
    period: Positive
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


def _schema(family: Family) -> "pa.Schema":
    """Columns of the file and their types; arrays are a list per row."""
    import pyarrow as pa

    types = {
        name: pa.list_(pa.float64(), math.prod(x)) if x else pa.float64()
        for name, x in family.shapes().items()
    }
    fields = {**types, "valid": pa.bool_(), "source": pa.string()}
    return pa.schema([pa.field(name, kind, nullable=False) for name, kind in fields.items()])


def table_of(family: Family, columns: dict[str, Array], source: list[str]) -> "pa.Table":
    """Table of a library's columns, (N, …) each."""
    import pyarrow as pa

    schema = _schema(family)
    arrays = {"source": pa.array(source, pa.string())}
    for name, x in columns.items():
        flat = pa.array(x.ravel())
        kind = schema.field(name).type
        arrays[name] = flat if x.ndim == 1 else pa.FixedSizeListArray.from_arrays(flat, type=kind)
    metadata = json.dumps({"format": FORMAT, **asdict(family)}).encode()
    return pa.table(arrays, schema=schema).replace_schema_metadata({METADATA_KEY: metadata})


def content_of(path: Path, table: "pa.Table") -> tuple[Family, dict[str, Array], list[str]]:
    """Family, columns and sources from a library's table that was read from ``path``.

    Raises:
        ArtifactError: when the format is unknown, or a column is missing, of a wrong type, or not finite.
    """
    family = _family(path, table)
    schema = _schema(family)
    columns: dict[str, Array] = {}
    with reading(path, "library"):
        table = table.select(schema.names)
        for field, expected in zip(table.schema, schema):
            if field.type != expected.type:
                raise ArtifactError(f"{path}: column {field.name} is {field.type}, expected {expected.type}")
        table = table.cast(schema)  # refuses empty cells
        for name, shape in family.shapes().items():
            column = table[name].combine_chunks()
            cells = (column.flatten() if shape else column).to_numpy(zero_copy_only=False)
            columns[name] = np.array(cells).reshape(len(table), *shape)
            # A margin without a limit, or a fitness without excitation of a direction, is infinite.
            if np.isnan(columns[name]).any() or (shape and np.isinf(columns[name]).any()):
                raise ArtifactError(f"{path}: column {name} is not finite")
    return family, columns, table["source"].to_pylist()


def _family(path: Path, table: "pa.Table") -> Family:
    stored = (table.schema.metadata or {}).get(METADATA_KEY)
    if stored is None:
        raise ArtifactError(f"{path} is a Parquet file, but not a library of sidegan")
    with reading(path, "library"):
        values = json.loads(stored)
        if (number := values.pop("format", None)) != FORMAT:
            raise ArtifactError(f"{path} has library format {number}, this version reads format {FORMAT}")
    try:
        family = build(Family, values)
    except ConfigError as error:
        raise ArtifactError(f"{path}: the library's metadata is wrong: {error}") from error
    if len(family.home) != family.joints:
        raise ArtifactError(f"{path}: home has {len(family.home)} of {family.joints} joints")
    return family
