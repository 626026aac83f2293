"""Files of numbers read in pieces: text with a first line of column names, Parquet and NPZ."""

import csv
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sidegan.base.names import counted
from sidegan.base.storage import reading
from sidegan.errors import RecordingError

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

Numbers = NDArray[np.float64]
Where = dict[str, list[str]]  # columns of time and of every signal; a single column may hold all joints

_SKIPPED = re.compile(r"line (\d+): expected (\d+) fields, saw (\d+)")
_BUFFER = 2**20  # bytes
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d*,\d+([eE][+-]?\d+)?\s*")
_LOOKED_AT = 100  # lines by which numbers with decimal commas are known


@dataclass(frozen=True)
class Piece:
    """Consecutive rows of a table."""

    columns: dict[str, Numbers]  # numbers by column, (S,) or (S, J); what is not a number is NaN
    rows: NDArray[np.int64]  # number of each row, as a person counts them in the file
    # row and reason of what could not even be cut into columns
    skipped: list[tuple[int, str]] = field(default_factory=list)


@dataclass(frozen=True)
class Table:
    """A file: its columns, and a function that reads some of them in pieces."""

    columns: list[str]
    pieces: Callable[[Sequence[str]], Iterator[Piece]]
    first: Mapping[str, str] = field(default_factory=dict)  # what stands in a text's first row, by column


def text_table(path: Path, rows: int, header: Sequence[str] | None = None) -> Table:
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
    layout = separator, decimal
    first = next(csv.reader(lines[0 if bare else 1 :][:1], delimiter=separator), [])
    fields = dict(zip(names, (text.strip() for text in first)))
    return Table(names, lambda columns: _text_pieces(path, names, layout, columns, rows, bare), fields)


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


def _text_pieces(
    path: Path,
    names: list[str],
    layout: tuple[str, str],
    columns: Sequence[str],
    rows: int,
    bare: bool,
) -> Iterator[Piece]:
    """Pieces of a text whose layout is the separator of its columns and the decimal mark of its numbers."""
    import pandas as pd

    # All columns are read: with a choice of them pandas does not notice a line with too many fields.
    options: dict[str, Any] = {
        "sep": layout[0],
        "decimal": layout[1],
        "header": None,
        "names": names,
        "index_col": False,
        "skiprows": 0 if bare else 1,
        "skip_blank_lines": False,
        "on_bad_lines": "warn",
        "encoding_errors": "replace",
    }
    line = 1 if bare else 2  # of the next row; people count the header as the first
    with reading(path, "text", RecordingError), pd.read_csv(path, **options, chunksize=rows) as reader:
        while True:
            with warnings.catch_warnings(record=True) as messages:
                warnings.simplefilter("always")
                frame = next(reader, None)
            if frame is None:
                return
            skipped = _skipped(messages)
            lines = _line_numbers(line, len(frame), {row for row, _ in skipped})
            line = int(max([*lines[-1:], *(row for row, _ in skipped), line - 1])) + 1
            yield Piece({c: _parsed(frame[c], layout[1]) for c in columns}, lines, skipped)


def _parsed(column: "pd.Series[Any]", decimal: str) -> Numbers:
    """Numbers of a column; pandas leaves it as text where one field is no number."""
    import pandas as pd

    if decimal == "," and not pd.api.types.is_numeric_dtype(column):
        column = column.astype(str).str.replace(",", ".", regex=False)
    return pd.to_numeric(column, errors="coerce").to_numpy(np.float64)


def _skipped(messages: list[warnings.WarningMessage]) -> list[tuple[int, str]]:
    """Lines that pandas could not cut into columns."""
    matches = [match for one in messages for match in _SKIPPED.finditer(str(one.message))]
    return [(int(m[1]), f"{counted(int(m[3]), 'field')}, expected {m[2]}") for m in matches]


def _line_numbers(first: int, count: int, skipped: set[int]) -> NDArray[np.int64]:
    """Line of each of ``count`` rows from line ``first`` on, when some lines were skipped."""
    if not skipped:
        return np.arange(first, first + count)
    lines = np.arange(first, first + count + len(skipped))
    return lines[~np.isin(lines, list(skipped))][:count]


def parquet_table(path: Path, rows: int) -> Table:
    """A Parquet file: a row per sample; a column may hold lists of all joints."""
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        names = list(file.schema_arrow.names)
    return Table(names, lambda columns: _parquet_pieces(path, columns, rows))


def _parquet_pieces(path: Path, columns: Sequence[str], rows: int) -> Iterator[Piece]:
    import pyarrow.parquet as pq

    row = 1
    # With its own ideas of buffers, pyarrow keeps all that it has read.
    with (
        reading(path, "Parquet", RecordingError),
        pq.ParquetFile(path, buffer_size=_BUFFER, pre_buffer=False) as file,
    ):
        for batch in file.iter_batches(rows, columns=list(columns)):
            numbers = {name: _numbers(batch.column(name)) for name in columns}
            yield Piece(numbers, np.arange(row, row + len(batch)))
            row += len(batch)


def _numbers(column: "pa.Array") -> Numbers:
    """A column as numbers, (S,) or, of lists, (S, J)."""
    import pyarrow as pa

    if pa.types.is_list(column.type) or pa.types.is_fixed_size_list(column.type):
        return np.array(column.to_pylist(), dtype=np.float64)
    return np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False), dtype=np.float64)


def npz_table(path: Path, rows: int) -> Table:
    """An NPZ file: an array (S,) per column, or (S, J) per signal; nothing in it is run."""
    with np.load(path, allow_pickle=False) as file:
        names = list(file.files)
    return Table(names, lambda columns: _npz_pieces(path, columns, rows))


def _npz_pieces(path: Path, columns: Sequence[str], rows: int) -> Iterator[Piece]:
    with reading(path, "NPZ", RecordingError), np.load(path, allow_pickle=False) as file:
        arrays = {name: _real(path, name, file[name]) for name in columns}
    lengths = {name: len(x) if x.ndim else 0 for name, x in arrays.items()}
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{name} has {n}" for name, n in lengths.items())
        raise RecordingError(f"{path}: the arrays are not of the same length: {listed}")
    count = max(lengths.values())
    for first in range(0, count, rows):
        piece = {name: x[first : first + rows] for name, x in arrays.items()}
        yield Piece(piece, np.arange(first, min(first + rows, count)) + 1)


def _real(path: Path, name: str, x: NDArray[Any]) -> Numbers:
    """An array of an NPZ file as numbers.

    Raises:
        RecordingError: when it holds text, dates or complex numbers, of which half would get lost.
    """
    if x.dtype.kind not in "fiub":
        raise RecordingError(f"{path}: array {name} holds {x.dtype}, expected real numbers")
    return np.asarray(x, dtype=np.float64)
