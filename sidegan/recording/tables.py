"""Files of numbers: text with a first line of column names, Parquet and NPZ."""

import csv
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from sidegan.base.names import counted
from sidegan.errors import RecordingError

Numbers = NDArray[np.float64]
Where = dict[str, list[str]]  # columns of time and of every signal; a single column may hold all joints

_SKIPPED = re.compile(r"line (\d+): expected (\d+) fields, saw (\d+)")
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d*,\d+([eE][+-]?\d+)?\s*")
_LOOKED_AT = 100  # lines that tell separator and decimal mark


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of a file as they are kept in it, of S rows; an element may be a list of all joints."""

    columns: Mapping[str, Any]
    rows: NDArray[np.int64]  # their numbers as people count them, (S,)
    skipped: Sequence[tuple[int, str]] = ()  # number and reason of rows that have no columns

    def first(self, name: str) -> str:
        """A column's first element as text; nothing where there is none."""
        return str(next(iter(self.columns[name]), "")).strip()

    def numbers(self, name: str) -> Numbers:
        """A column, (S,) or, of lists, (S, J); NaN where it holds no number.

        Raises:
            RecordingError: when it holds complex numbers.
        """
        values = np.atleast_1d(self.columns[name])
        if len(values) and isinstance(values[0], list | np.ndarray):
            values = np.stack([*values])
        if np.iscomplexobj(values):
            raise RecordingError(f"array {name} holds {values.dtype}, expected real numbers")
        if values.ndim == 1:
            values = pd.to_numeric(pd.Series(values), errors="coerce").to_numpy(np.float64)
        return np.asarray(values, dtype=np.float64)


def text_table(path: Path) -> Table:
    """A text file whose columns are separated by commas, semicolons, tabs or spaces.

    Between semicolons and tabs, numbers may have decimal commas.

    Raises:
        RecordingError: when it is empty, has no first line of column names, or one with a name twice.
    """
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        lines = list(islice(file, _LOOKED_AT))
    if not lines or not lines[0].strip():
        raise RecordingError(f"{path} is empty")
    separator, decimal = _format_of(lines)
    names = [name.strip() for name in next(csv.reader(lines[:1], delimiter=separator, skipinitialspace=True))]
    if all(_is_number(name.replace(decimal, ".")) for name in names):
        raise RecordingError(
            f"{path} begins with numbers, expected a first line of column names: write one into it, such as "
            "t,q1,q2,tau1,tau2"
        )
    if len(set(names)) < len(names):
        raise RecordingError(f"{path}: a column is named twice: {', '.join(names)[:100]!r}")
    return _text_rows(path, [name or f"column {i + 1}" for i, name in enumerate(names)], separator, decimal)


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


def _text_rows(path: Path, names: list[str], separator: str, decimal: str) -> Table:
    """Rows of a text below its first line, under these names."""
    options: dict[str, Any] = {"sep": separator, "decimal": decimal, "index_col": False, "header": None}
    options |= {"names": names, "skiprows": 1, "skip_blank_lines": False, "encoding_errors": "replace"}
    # All columns are read: with a choice of them pandas does not notice a line with too many fields.
    with warnings.catch_warnings(record=True) as messages:
        warnings.simplefilter("always")
        frame = pd.read_csv(path, on_bad_lines="warn", **options)
    if decimal == ",":  # pandas leaves a column as text where one field is no number
        texts = frame.select_dtypes(exclude="number")
        frame[texts.columns] = texts.astype(str).replace(",", ".", regex=True)
    matches = [match for one in messages for match in _SKIPPED.finditer(str(one.message))]
    skipped = [(int(m[1]), f"{counted(int(m[3]), 'field')}, expected {m[2]}") for m in matches]
    lines = np.arange(len(frame) + len(skipped)) + 2  # people count the header as the first
    rows = np.setdiff1d(lines, [row for row, _ in skipped], assume_unique=True)[: len(frame)]
    return Table({name: frame[name] for name in names}, rows, skipped)


def parquet_table(path: Path) -> Table:
    """A Parquet file: a row per sample; a column may hold lists of all joints. Pictures stay in it."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    plain = [field.name for field in pq.read_schema(path) if not pa.types.is_struct(field.type)]
    frame = pd.read_parquet(path, columns=plain)
    return Table({name: frame[name] for name in plain}, np.arange(len(frame)) + 1)


def npz_table(path: Path) -> Table:
    """An NPZ file: an array (S,) per column, or (S, J) per signal; nothing in it is run."""
    with np.load(path, allow_pickle=False) as file:
        arrays = dict(file.items())
    return Table(arrays, np.arange(max((len(x) for x in arrays.values() if x.ndim), default=0)) + 1)
