"""Files of numbers: text with a first line of column names, Parquet and NPZ."""

import csv
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sidegan.base.names import counted
from sidegan.base.storage import reading
from sidegan.errors import RecordingError

if TYPE_CHECKING:
    import pyarrow as pa

Numbers = NDArray[np.float64]
Where = dict[str, list[str]]  # columns of time and of every signal; a single column may hold all joints

_SKIPPED = re.compile(r"line (\d+): expected (\d+) fields, saw (\d+)")
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d*,\d+([eE][+-]?\d+)?\s*")
_LOOKED_AT = 100  # lines that tell separator and decimal mark


class Rows(NamedTuple):
    """Columns of a file."""

    columns: dict[str, Numbers]  # (S,) each, or (S, J) where a column holds all joints
    numbers: NDArray[np.int64]  # of the rows as people count them, (S,)
    skipped: Sequence[tuple[int, str]] = ()  # number and reason of rows that have no columns


@dataclass(frozen=True)
class Table:
    """A file: its columns, and a function that reads some of them."""

    columns: list[str]
    read: Callable[[Sequence[str]], Rows]
    first: Mapping[str, str] = field(default_factory=dict)  # a text's first row, by column


class _Layout(NamedTuple):
    """How a text is divided into rows and numbers."""

    names: list[str]  # of its columns
    separator: str  # of its columns
    decimal: str  # mark of its numbers
    header: int  # lines before the first row


def text_table(path: Path, header: Sequence[str] | None = None) -> Table:
    """A text file whose columns are separated by commas, semicolons, tabs or spaces.

    Between semicolons and tabs, numbers may have decimal commas.

    Raises:
        RecordingError: when it is empty, or has both or neither of a first line of column names and a header.
    """
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        lines = list(islice(file, _LOOKED_AT))
    if not lines or not lines[0].strip():
        raise RecordingError(f"{path} is empty")
    separator, decimal = _format_of(lines)
    found = [name.strip() for name in next(csv.reader(lines[:1], delimiter=separator, skipinitialspace=True))]
    found = [name or f"column {i + 1}" for i, name in enumerate(found)]
    bare = all(_is_number(name.replace(decimal, ".")) for name in found)
    if bare != (header is not None):
        wrong = "begins with numbers, expected a first line of column names"
        hint = '; say what they are: \'recording.header=[t,"q{index}","tau{index}"]\''
        named = "has a first line of column names already: leave recording.header out"
        raise RecordingError(f"{path} {wrong + hint if bare else named}")
    names = [*header] if header is not None else found
    if len(names) != len(found):
        raise RecordingError(f"{path} has {counted(len(found), 'column')}, recording.header has {len(names)}")
    if len(set(names)) < len(names):
        raise RecordingError(f"{path}: a column is named twice: {', '.join(names)[:100]!r}")
    layout = _Layout(names, separator, decimal, 0 if bare else 1)
    first = next(csv.reader(lines[layout.header :][:1], delimiter=separator), [])
    fields = dict(zip(names, (text.strip() for text in first)))
    return Table(names, lambda columns: _text_rows(path, layout, columns), fields)


def _format_of(lines: Sequence[str]) -> tuple[str, str]:
    """Separator of a text's columns, and decimal mark of its numbers, from its first lines."""
    for separator in ";\t":
        fields = [field for line in lines for field in line.split(separator)]
        commas = sum(_DECIMAL_COMMA.fullmatch(field) is not None for field in fields)
        if separator in lines[0] and commas and not any("." in x and _is_number(x) for x in fields):
            return separator, ","
    return max(",;\t ", key=lines[0].count), "."


def _is_number(text: str) -> bool:
    """Whether a field is a number, or says that it is none."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _text_rows(path: Path, layout: _Layout, columns: Sequence[str]) -> Rows:
    import pandas as pd

    options: dict[str, Any] = {"sep": layout.separator, "decimal": layout.decimal, "index_col": False}
    options |= {"header": None, "names": layout.names, "skiprows": layout.header, "skip_blank_lines": False}
    # All columns are read: with a choice of them pandas does not notice a line with too many fields.
    with reading(path, "text", RecordingError), warnings.catch_warnings(record=True) as messages:
        warnings.simplefilter("always")
        frame = pd.read_csv(path, on_bad_lines="warn", encoding_errors="replace", **options)
    matches = [match for one in messages for match in _SKIPPED.finditer(str(one.message))]
    skipped = [(int(m[1]), f"{counted(int(m[3]), 'field')}, expected {m[2]}") for m in matches]
    lines = np.arange(len(frame) + len(skipped)) + layout.header + 1  # people count the header as the first
    numbers = np.setdiff1d(lines, [row for row, _ in skipped], assume_unique=True)[: len(frame)]
    return Rows({name: _parsed(frame[name], layout.decimal) for name in columns}, numbers, skipped)


def _parsed(column: Any, decimal: str) -> Numbers:
    """Numbers of a column; pandas leaves it as text where one field is no number."""
    import pandas as pd

    if decimal == "," and not pd.api.types.is_numeric_dtype(column):
        column = column.astype(str).str.replace(",", ".", regex=False)
    return pd.to_numeric(column, errors="coerce").to_numpy(np.float64)


def parquet_table(path: Path) -> Table:
    """A Parquet file: a row per sample; a column may hold lists of all joints."""
    import pyarrow.parquet as pq

    def read(columns: Sequence[str]) -> Rows:
        with reading(path, "Parquet", RecordingError), pq.ParquetFile(path) as file:
            table = file.read(columns=[*columns])
            return Rows({name: _numbers(table[name]) for name in columns}, np.arange(len(table)) + 1)

    return Table(pq.read_schema(path).names, read)


def _numbers(column: "pa.ChunkedArray") -> Numbers:
    """A column as numbers, (S,) or, of lists, (S, J)."""
    import pyarrow as pa

    if pa.types.is_list(column.type) or pa.types.is_fixed_size_list(column.type):
        return np.array(column.to_pylist(), dtype=np.float64)
    return np.asarray(column.cast(pa.float64()).to_numpy(), dtype=np.float64)


def npz_table(path: Path) -> Table:
    """An NPZ file: an array (S,) per column, or (S, J) per signal; nothing in it is run."""

    def read(columns: Sequence[str]) -> Rows:
        with reading(path, "NPZ", RecordingError), np.load(path, allow_pickle=False) as file:
            arrays = {name: _real(path, name, file[name]) for name in columns}
        lengths = {name: len(x) if x.ndim else 0 for name, x in arrays.items()}
        if len(set(lengths.values())) > 1:
            listed = ", ".join(f"{name} has {n}" for name, n in lengths.items())
            raise RecordingError(f"{path}: the arrays are not of the same length: {listed}")
        return Rows(arrays, np.arange(max(lengths.values())) + 1)

    with np.load(path, allow_pickle=False) as file:
        return Table([*file.files], read)


def _real(path: Path, name: str, x: NDArray[Any]) -> Numbers:
    """An array of an NPZ file as numbers.

    Raises:
        RecordingError: when it holds text, dates or complex numbers, of which half would get lost.
    """
    if x.dtype.kind not in "fiub":
        raise RecordingError(f"{path}: array {name} holds {x.dtype}, expected real numbers")
    return np.asarray(x, dtype=np.float64)
