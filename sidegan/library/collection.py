"""A trajectory library: coefficients with their margins, excitation and origin."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.storage import parquet_rows, read_parquet, write_parquet
from sidegan.errors import ArtifactError, ShapeError
from sidegan.library.parquet import MARGIN, OPTIONS, Family, content_of, table_of

if TYPE_CHECKING:
    from sidegan.robot import Arm

LIBRARY = "library.parquet"  # file name in a folder


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
        """The trajectories at K indices, in that order."""
        index = np.asarray(indices, int)
        columns = {name: x[index] for name, x in self.columns().items()}
        return replace(self, **_fields(columns), source=[self.source[i] for i in index.tolist()])

    def merge(self, *others: "Library") -> "Library":
        """These trajectories followed by the others'; a ShapeError if their ``family`` differs."""
        return _joined((self, *others), sum(map(len, (self, *others))))

    def save(self, path: Path) -> None:
        """Write a Parquet file, a row per trajectory, atomically."""
        write_parquet(path, table_of(self.family(), self.columns(), self.source), **OPTIONS)

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
        return _joined((part for file in paths for part in _parts(file, arm)), rows)


def _parts(path: Path, arm: "Arm | None") -> Iterator[Library]:
    """The content of a file, piece by piece."""
    for table in read_parquet(path):
        family, columns, source = content_of(path, table)
        if arm is not None and arm.digest != family.digest:
            raise ArtifactError(f"{path} was made for {arm.unlike(family.robot, family.digest)}")
        facts = {name: getattr(family, name) for name in ("robot", "digest", "period")}
        yield Library(**_fields(columns), **facts, source=source, home=tuple(family.home))


def _joined(parts: Iterable[Library], count: int) -> Library:
    """A library of ``count`` trajectories from its parts, with only one part at a time in memory."""
    first = None
    rows = 0
    columns = dict[str, Array]()
    source = list[str]()
    for part in parts:
        first = first or part
        _refuse_others(asdict(first.family()), asdict(part.family()))
        for name, x in part.columns().items():
            columns.setdefault(name, np.empty((count, *x.shape[1:]), x.dtype))[rows : rows + len(part)] = x
        rows += len(part)
        source.extend(part.source)
    assert first is not None
    return replace(first, **_fields(columns), source=source)


def _refuse_others(first: dict[str, Any], other: dict[str, Any]) -> None:
    differences = [f"{key} {first[key]} and {other[key]}" for key in first if first[key] != other[key]]
    if differences:
        raise ShapeError(f"libraries that cannot be merged differ in {'; '.join(differences)}")


def _fields(columns: dict[str, Array]) -> dict[str, Any]:
    """Constructor arguments from the columns of a file."""
    margins = {name.removeprefix(MARGIN): x for name, x in columns.items() if name.startswith(MARGIN)}
    return {name: x for name, x in columns.items() if not name.startswith(MARGIN)} | {"margins": margins}
