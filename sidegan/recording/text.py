"""Text files with a first line of column names, in pieces."""

import csv
import re
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sidegan.errors import RecordingError
from sidegan.recording.tables import Piece, Table, reading

_SKIPPED = re.compile(r"line (\d+): expected (\d+) fields, saw (\d+)")


def text_table(path: Path, rows: int) -> Table:
    """A text file whose columns are separated by commas, semicolons, tabs or spaces.

    Raises:
        RecordingError: when it is empty or its first line is not one of column names.
    """
    import pandas as pd

    with path.open(encoding="utf-8", errors="replace", newline="") as file:
        first = file.readline()
    if not first.strip():
        raise RecordingError(f"{path} is empty")
    separator = max(",;\t ", key=first.count)
    names = [name.strip() for name in next(csv.reader([first], delimiter=separator))]
    names = [name or f"column {i + 1}" for i, name in enumerate(names)]
    if len(set(names)) < len(names):
        raise RecordingError(f"{path}: a column is named twice in the first line: {first.strip()[:100]!r}")
    if pd.to_numeric(pd.Series(names), errors="coerce").notna().all():
        raise RecordingError(f"{path} begins with numbers, expected a first line of column names")
    return Table(names, lambda columns: _pieces(path, names, separator, columns, rows))


def _pieces(
    path: Path, names: list[str], separator: str, columns: Sequence[str], rows: int
) -> Iterator[Piece]:
    import pandas as pd

    # All columns are read: with a choice of them pandas does not notice a line with too many fields.
    options: dict[str, Any] = {
        "sep": separator,
        "header": None,
        "names": names,
        "index_col": False,
        "skiprows": 1,
        "skip_blank_lines": False,
        "on_bad_lines": "warn",
        "encoding_errors": "replace",
    }
    line = 2  # of the next row; people count the header as the first
    with reading(path), pd.read_csv(path, **options, chunksize=rows) as reader:
        while True:
            with warnings.catch_warnings(record=True) as messages:
                warnings.simplefilter("always")
                frame = next(reader, None)
            if frame is None:
                return
            skipped = _skipped(messages)
            lines = _line_numbers(line, len(frame), {row for row, _ in skipped})
            line = int(max([*lines[-1:], *(row for row, _ in skipped), line - 1])) + 1
            numbers = {c: pd.to_numeric(frame[c], errors="coerce").to_numpy(np.float64) for c in columns}
            yield Piece(numbers, lines, skipped)


def _skipped(messages: list[warnings.WarningMessage]) -> list[tuple[int, str]]:
    """Lines that pandas could not cut into columns."""
    matches = [match for one in messages for match in _SKIPPED.finditer(str(one.message))]
    return [(int(m[1]), f"{m[3]} fields, expected {m[2]}") for m in matches]


def _line_numbers(first: int, count: int, skipped: set[int]) -> NDArray[np.int64]:
    """Line of each of ``count`` rows from line ``first`` on, when some lines were skipped."""
    if not skipped:
        return np.arange(first, first + count)
    lines = np.arange(first, first + count + len(skipped))
    return lines[~np.isin(lines, list(skipped))][:count]
