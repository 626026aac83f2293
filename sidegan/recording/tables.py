"""Tables of columns, read from Parquet, JSON, NPZ, HDF5 and MATLAB files."""

import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from sidegan.base.arrays import Array
from sidegan.base.extras import extra
from sidegan.base.names import dotted
from sidegan.errors import RecordingError
from sidegan.recording import thresholds
from sidegan.recording.column_names import stamps_of

SignalColumns = dict[str, list[str]]  # columns of time and each signal; a single column may hold all joints
_NAMES = re.compile(r"(.*[._])?(joint_?)?names?", re.IGNORECASE)  # columns that may list joints
_APART = 10_000  # steps between episodes, whose unit of time is not known: seconds to minutes at usual rates
_GROUP = re.compile(r"(?:^|(?:demo|episode|traj|trajectory|rollout|trial|run)_?)(\d+)\.")  # of an episode


@dataclass(frozen=True, eq=False)
class Table:
    """Raw columns of a file with S rows; an element may be a list of all joints."""

    columns: Mapping[str, Any]
    rows: Array  # row numbers as people count them, (S,)
    skipped: Sequence[tuple[int, str]] = ()  # row numbers and reasons of unreadable rows
    units: Mapping[str, str] = field(default_factory=dict)  # of columns, if a row below the header has them
    file: str = ""  # its name, for messages

    def heading(self, name: str) -> str:
        """A column's name with its unit."""
        return f"{name} [{self.units[name]}]" if name in self.units else name

    def first(self, name: str) -> str:
        """A column's first element as text; empty if there is none."""
        return str(next(iter(self.columns[name]), "")).strip()

    def forget(self, names: Iterable[str]) -> None:
        """Release the memory of columns that are no longer needed."""
        for name in names:
            if isinstance(self.columns, dict):
                self.columns.pop(name, None)

    def width(self, name: str) -> int:
        """Number of elements that a column has in each row: 1 unless it holds lists."""
        values = self.columns[name]
        if np.ndim(values) == 2:
            return int(np.shape(values)[1])
        return len(np.atleast_1d(next(iter(values), 0))) if np.ndim(values) == 1 else 0

    @cached_property
    def joint_names(self) -> list[str]:
        """Joints in the order of all rows' lists, as in a JointState; empty if no column lists them."""
        columns = [name for name in filter(_NAMES.fullmatch, self.columns) if self.width(name) > 1]
        if not columns:
            return []
        orders = {tuple(map(str, row)) for row in self.columns[columns[0]]}
        if len(orders) > 1:
            raise RecordingError(f"{self.file}: the joints in column {columns[0]} change from row to row")
        return [*orders.pop()]

    def numbers(self, name: str) -> Array:
        """A column, (S,), or (S, J) if it holds lists; NaN where it holds no number."""
        values = np.atleast_1d(self.columns[name])
        if np.iscomplexobj(values):
            raise RecordingError(f"{self.file}: {name} holds {values.dtype}, expected real numbers")
        if len(values) and isinstance(values[0], list | np.ndarray):
            try:
                values = np.stack([*values]).astype(np.float64)
            except (TypeError, ValueError) as error:  # ragged, or lists of structures
                raise RecordingError(
                    f"{self.file}: {name} must have equally long lists of numbers, one per row: {error}"
                ) from error
        if values.ndim == 1:
            values = pd.to_numeric(pd.Series(values), errors="coerce").to_numpy(np.float64)
        return np.asarray(values, dtype=np.float64)


def parquet_table(path: Path) -> Table:
    """Table of a Parquet file with a row per sample; columns may hold lists of all joints.

    Binary columns, such as images, are left out.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    names = [field.name for field in pq.read_schema(path) if not pa.types.is_binary(field.type)]
    return Table(_Parquet(path, names), np.arange(pq.read_metadata(path).num_rows) + 1)


class _Parquet(Mapping[str, Any]):
    """Columns of a Parquet file, read on access."""

    def __init__(self, path: Path, names: Sequence[str]) -> None:
        self.path, self.names = path, names

    def __getitem__(self, name: str) -> Any:
        import pyarrow as pa
        import pyarrow.parquet as pq

        # pandas metadata may declare the column an index, which would hide it
        column = pq.read_table(self.path, columns=[name]).to_pandas(ignore_metadata=True).iloc[:, 0]
        pa.default_memory_pool().release_unused()  # otherwise it keeps the memory that decoding used
        return column

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)


def json_table(path: Path) -> Table:
    """Table of JSON lines, or an array, of an object per row; nested names are joined by dots.

    Lists are numbered. An object of arrays is read as an NPZ file is.
    """
    rows, found, skipped = [], [], []
    text = path.read_text(encoding="utf-8-sig", errors="replace")
    try:
        content = json.loads(text)
    except ValueError:
        content = text.split("\n")
    if isinstance(content, dict):
        return _of_arrays(_arrays(content))
    for row, line in enumerate(content, 1):
        try:
            found.append(dict(_leaves(json.loads(line) if isinstance(line, str) else line, "")))
            rows.append(row)
        except ValueError:
            skipped += [(row, "is not a JSON object")] if line != "" else []
    frame = pd.DataFrame(found)
    return Table({str(name): frame[name] for name in frame}, np.array(rows, dtype=np.int64), skipped)


def _leaves(value: Any, name: str) -> Iterator[tuple[str, Any]]:
    """Names and values of all leaves of a JSON value; ValueError if it is not an object."""
    if isinstance(value, dict):
        for key, child in value.items():
            yield from _leaves(child, f"{name}.{key}".lstrip("."))
    elif not name:
        raise ValueError("no object")
    elif isinstance(value, list):
        for k, child in enumerate(value):
            yield from _leaves(child, f"{name}[{k}]")
    else:
        yield name, value


def npz_table(path: Path) -> Table:
    """Table of an NPZ file: an array (S,) per column, or (S, J) or (J, S) per signal; pickles are refused."""
    with np.load(path, allow_pickle=False) as file:
        return _of_arrays(dict(file.items()))


def mat_table(path: Path) -> Table:
    """Table of a MATLAB file, as of an NPZ file; names in structures are joined by dots."""
    import scipy

    with path.open("rb") as file:
        if file.read(10) == b"MATLAB 7.3":
            return hdf5_table(path)
    content = scipy.io.loadmat(path, simplify_cells=True)
    return _of_arrays({name: x for name, x in _arrays(content).items() if not name.startswith("__")})


def hdf5_table(path: Path) -> Table:
    """Table of an HDF5 file, as of an NPZ file, without images; names in groups are joined by dots."""
    with extra("hdf5"):
        import h5py
    kinds = {1: "fiu", 2: "fiu", 3: "fi"}  # of numbers, by dimensions: unsigned ones in three may be images
    arrays: dict[str, Any] = {}

    def keep(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.dtype.kind in kinds.get(item.ndim, ""):
            arrays[name.replace("/", ".")] = item[...]

    with h5py.File(path) as file:
        file.visititems(keep)
    return _of_arrays(arrays)


def _arrays(content: Mapping[str, Any]) -> dict[str, Any]:
    """Arrays of a structure and of nested ones, by dotted names."""
    return {name: np.asarray(x) for name, x in dotted(content).items() if np.ndim(x)}


def _of_arrays(arrays: Mapping[str, Any]) -> Table:
    """A table of arrays (S,), (S, J), or (J, S), or of N episodes: (N, S, J), or each in its own group."""
    groups: dict[str, dict[str, Any]] = {}
    for name, x in arrays.items():
        if number := _GROUP.search(name):
            groups.setdefault(number[1], {})[_GROUP.sub("", name, 1)] = x
    stacks = [x.shape for x in arrays.values() if x.ndim == 3]
    leads = Counter(shape[:2] for shape in stacks if shape[2] <= thresholds.WIDEST_STACK)
    ((lead, several),) = leads.most_common(1) or [((0, 0), 0)]
    if groups:
        return _episodes([groups[key] for key in sorted(groups, key=int)])
    if several > 1:  # the time may be the same in all episodes, (S,)
        stacked = {name: x for name, x in arrays.items() if x.shape[:2] == lead}
        same = {name: x for name, x in arrays.items() if x.shape == lead[1:]}
        return _episodes([{k: x[n] for k, x in stacked.items()} | same for n in range(lead[0])])
    longest = max((max(x.shape) for x in arrays.values() if x.ndim in (1, 2)), default=0)
    upright = {
        name: x.T if x.ndim == 2 and x.shape[1] == longest != x.shape[0] else x for name, x in arrays.items()
    }
    return Table(upright, np.arange(max((len(x) for x in upright.values() if x.ndim), default=0)) + 1)


def _episodes(episodes: Sequence[Mapping[str, Any]]) -> Table:
    """A table of episodes, arrays (S, ...) each, on one clock, with pauses between them."""
    names = [name for name in episodes[0] if all(name in episode for episode in episodes)]
    parts = [_of_arrays({name: episode[name] for name in names}) for episode in episodes]
    columns = {name: np.concatenate([part.columns[name] for part in parts]) for name in names}
    first = np.cumsum([0, *(len(part.rows) for part in parts)])[1:-1]
    for name in stamps_of(names):
        time = columns[name].ravel()
        steps = np.diff(time, prepend=time[:1])
        steps[first] = _APART * np.median(steps)
        columns[name] = time[0] + np.cumsum(steps)
    rows = [part.rows + k * _APART + at for (k, part), at in zip(enumerate(parts), (0, *first))]
    return Table(columns, np.concatenate(rows))
