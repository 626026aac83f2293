"""A trajectory library: coefficients with their margins, excitation and origin, and its Parquet file.

The file has a row per trajectory, and the arm and the family in its metadata.
"""

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.storage import parquet_rows, read_parquet, reading, write_parquet
from sidegan.base.typed import Number, Positive, build
from sidegan.errors import ArtifactError, ConfigError, ShapeError

if TYPE_CHECKING:  # too slow to import for `--help`
    import pyarrow as pa

    from sidegan.robot import Arm

LIBRARY = "library.parquet"  # file name in a folder
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


@dataclass(frozen=True, eq=False)
class Library:
    """N trajectories of an arm; arrays are float64 (``valid``: bool)."""

    coefficients: Array  # [rad/s], (N, J, H, 2)
    valid: Array  # whether every constraint holds over the whole period, (N,)
    margins: dict[str, Array]  # signed margin of each constraint in its unit, ≥ 0 if it holds, (N,) each
    fitness: Array  # eigenvalue fitness, (N,); infinite if a direction is not excited
    diagonal_fitness: Array  # (N,); infinite if a base parameter is not excited
    spectrum: Array  # eigenvalues of YᵀY / T in an orthonormal basis, ascending, (N, p)
    diagonal: Array  # diagonal of YᵀY / T over the base columns, (N, p)
    source: list[str]  # origin of each trajectory, such as "seeds" or "eigen", N of them
    robot: str  # name of the arm
    digest: str  # of the arm
    period: float  # duration of a trajectory [s]
    home: tuple[float, ...]  # joint positions at both ends [rad or m], J of them

    def __len__(self) -> int:
        return len(self.coefficients)

    def columns(self) -> dict[str, Array]:
        """Every array, (N, …), by the name of its column in the file."""
        margins = {f"{MARGIN}{name}": x for name, x in self.margins.items()}
        names = self.family().shapes()
        return {name: margins[name] if name in margins else getattr(self, name) for name in names}

    def family(self) -> Family:
        """Properties that libraries must share to be merged."""
        _, joints, harmonics, _ = self.coefficients.shape
        return Family(
            robot=self.robot,
            digest=self.digest,
            joints=joints,
            harmonics=harmonics,
            period=self.period,
            home=list(self.home),
            parameters=self.diagonal.shape[1],
            margins=sorted(self.margins),
        )

    def take(self, indices: Array | Sequence[int]) -> "Library":
        """The trajectories at K indices, in that order; or those that a mask, (N,) bool, marks."""
        index = np.asarray(indices)
        if not index.size:  # NumPy takes an empty list for floats
            index = index.astype(int)
        index = np.arange(len(self))[index]
        columns = {name: x[index] for name, x in self.columns().items()}
        return replace(self, **_fields(columns), source=[self.source[i] for i in index.tolist()])

    def read_only(self) -> "Library":
        """The same trajectories in arrays that cannot be changed; those of this library still can."""
        columns = {name: x.view() for name, x in self.columns().items()}
        for x in columns.values():
            x.flags.writeable = False
        return replace(self, **_fields(columns))

    def merge(self, *others: "Library") -> "Library":
        """These trajectories followed by the others'; a ShapeError if their ``family`` differs."""
        return join((self, *others), sum(map(len, (self, *others))))

    def save(self, path: Path) -> None:
        """Write a Parquet file, a row per trajectory, atomically."""
        import pyarrow as pa

        schema = _schema(self.family())
        arrays = {"source": pa.array(self.source, pa.string())}
        for name, x in self.columns().items():
            flat = pa.array(x.ravel())
            kind = schema.field(name).type
            arrays[name] = flat if x.ndim == 1 else pa.FixedSizeListArray.from_arrays(flat, type=kind)
        metadata = json.dumps({"format": FORMAT, **asdict(self.family())}).encode()
        table = pa.table(arrays, schema=schema).replace_schema_metadata({METADATA_KEY: metadata})
        write_parquet(path, table, **OPTIONS)

    @classmethod
    def load(cls, path: Path, arm: "Arm | None" = None, *others: Path) -> "Library":
        """The exact library that ``save`` wrote, for ``arm``, or for any arm if None.

        Several files are merged, with a single copy in memory.

        Raises:
            ArtifactError: when a file is missing, damaged, of an unknown format, or for a different arm.
            ShapeError: when the ``family`` of two files differs.
        """
        paths = (path, *others)
        rows = sum(map(parquet_rows, paths))
        return join((part for file in paths for part in _parts(file, arm)), rows)


def _parts(path: Path, arm: "Arm | None") -> Iterator[Library]:
    """The content of a file, piece by piece.

    Raises:
        ArtifactError: when the format is unknown, or a column is missing, of a wrong type, or not finite.
    """
    for table in read_parquet(path):
        family = _family(path, table)
        if arm is not None and arm.digest != family.digest:
            raise ArtifactError(f"{path} was made for {arm.unlike(family.robot, family.digest)}")
        schema = _schema(family)
        columns: dict[str, Array] = {}
        with reading(path, "library"):
            table = table.select(schema.names)
            for field, expected in zip(table.schema, schema):
                if field.type != expected.type:
                    what = f"{path}: column {field.name}"
                    raise ArtifactError(f"{what} is {field.type}, expected {expected.type}")
            table = table.cast(schema)  # refuses empty cells
            for name, shape in family.shapes().items():
                column = table[name].combine_chunks()
                cells = (column.flatten() if shape else column).to_numpy(zero_copy_only=False)
                columns[name] = np.array(cells).reshape(len(table), *shape)
                # A margin without a limit, or a fitness without excitation of a direction, is infinite.
                if np.isnan(columns[name]).any() or (shape and np.isinf(columns[name]).any()):
                    raise ArtifactError(f"{path}: column {name} is not finite")
        facts = {name: getattr(family, name) for name in ("robot", "digest", "period")}
        source = table["source"].to_pylist()
        yield Library(**_fields(columns), **facts, source=source, home=tuple(family.home))


def join(parts: Iterable[Library], count: int) -> Library:
    """A library of ``count`` trajectories from its parts, with only one part at a time in memory.

    Raises:
        ShapeError: when the ``family`` of two parts differs.
    """
    first = None
    rows = 0
    columns = dict[str, Array]()
    source = list[str]()
    for part in parts:
        first = part if first is None else first
        own, other = asdict(first.family()), asdict(part.family())
        if wrong := [f"{key} {own[key]} and {other[key]}" for key in own if own[key] != other[key]]:
            raise ShapeError(f"libraries that cannot be merged differ in {'; '.join(wrong)}")
        for name, x in part.columns().items():
            columns.setdefault(name, np.empty((count, *x.shape[1:]), x.dtype))[rows : rows + len(part)] = x
        rows += len(part)
        source.extend(part.source)
    assert first is not None
    return replace(first, **_fields(columns), source=source)


def _fields(columns: dict[str, Array]) -> dict[str, Any]:
    """Constructor arguments from the columns of a file."""
    margins = {name.removeprefix(MARGIN): x for name, x in columns.items() if name.startswith(MARGIN)}
    return {name: x for name, x in columns.items() if not name.startswith(MARGIN)} | {"margins": margins}


def _schema(family: Family) -> "pa.Schema":
    """Columns of the file and their types; arrays are a list per row."""
    import pyarrow as pa

    types = {
        name: pa.list_(pa.float64(), math.prod(x)) if x else pa.float64()
        for name, x in family.shapes().items()
    }
    fields = {**types, "valid": pa.bool_(), "source": pa.string()}
    return pa.schema([pa.field(name, kind, nullable=False) for name, kind in fields.items()])


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
