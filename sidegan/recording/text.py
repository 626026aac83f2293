"""Text with a first line of column names, in the encodings and with the separators that programs write."""

import csv
import io
import re
import warnings
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from sidegan.base.names import counted
from sidegan.errors import RecordingError
from sidegan.recording.tables import Table

_SKIPPED = re.compile(r"line (\d+): expected (\d+) fields, saw (\d+)")
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d*,\d+([eE][+-]?\d+)?\s*")
_LOOKED_AT = 100  # lines that tell separator and decimal mark
_SAMPLE = 1 << 16  # bytes that tell the encoding
_FIELDS = ("position", "velocity", "effort")  # of a joint state, in its order


def text_table(path: Path) -> Table:
    """A text file whose columns are separated by commas, semicolons, tabs or spaces.

    Between semicolons and tabs, numbers may have decimal commas. Joint states as ``ros2 topic echo --csv``
    writes them need no names.
    """
    encoding = _encoding_of(path)
    with path.open(encoding=encoding, errors="replace", newline="") as file:
        lines = list(islice(file, _LOOKED_AT))
    if not lines or not lines[0].strip():
        raise RecordingError(f"{path} is empty")
    separator, decimal = _format_of(lines)
    names = [name.strip() for name in next(csv.reader(lines[:1], delimiter=separator, skipinitialspace=True))]
    form = {"sep": separator, "decimal": decimal, "encoding": encoding}
    if echoed := _echoed(path, names):
        return _text_rows(path, echoed, first=1, **form)
    if all(_is_number(name.replace(decimal, ".")) for name in names):
        raise RecordingError(
            f"{path} begins with numbers, expected a header line of column names: add one, such as "
            "t,q1,q2,tau1,tau2"
        )
    if len(set(names)) < len(names):
        raise RecordingError(f"{path}: a column name occurs twice: {', '.join(names)[:100]!r}")
    return _text_rows(path, [name or f"column {i + 1}" for i, name in enumerate(names)], first=2, **form)


def _encoding_of(path: Path) -> str:
    """UTF-16 by its mark, UTF-8 where the text is that, or else the encoding that Windows had."""
    with path.open("rb") as file:
        sample = file.read(_SAMPLE)
    if sample.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    try:  # a last character that is cut off is no error
        io.TextIOWrapper(io.BytesIO(sample.rpartition(b"\n")[0] or sample), "utf-8").read()
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


def _format_of(lines: Sequence[str]) -> tuple[str, str]:
    """Separator of a text's columns, that with the most numbers in its rows, and their decimal mark."""
    rows = lines[1:] or lines
    counts = {}
    for separator in ";\t, ":
        fields = [field for row in rows for field in row.split(separator)]
        commas = sum(_DECIMAL_COMMA.fullmatch(field) is not None for field in fields)
        points = [field for field in fields if _is_number(field)]
        comma = separator in ";\t" and commas and not any("." in field for field in points)
        counts[separator, "," if comma else "."] = len(points) + (commas if comma else 0)
    return max(counts, key=lambda one: (counts[one], lines[0].count(one[0])))


def _is_number(text: str) -> bool:
    """Whether a field is a number, or says that it is none."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _echoed(path: Path, fields: Sequence[str]) -> list[str]:
    """Names for the columns of joint states without names; none where a first line is no joint state.

    Seconds, nanoseconds and the frame are followed by the joints' names and their values.
    """
    numbers = [_is_number(field) for field in fields]
    if len(fields) < 5 or not (fields[0].isdigit() and fields[1].isdigit()) or numbers[2] or numbers[3]:
        return []
    joints = numbers.index(True, 3) - 3 if any(numbers[3:]) else 0
    signals, rest = divmod(len(fields) - 3 - joints, joints or 1)
    if not joints or rest or not all(numbers[3 + joints :]):
        return []
    kinds = _FIELDS if signals == len(_FIELDS) else ("position", "effort")
    names = [f"{kind}_{k}" for kind in ("name", *kinds) for k in range(joints)]
    header = ["stamp.sec", "stamp.nanosec", "frame", *names]
    if signals != len(_FIELDS):
        raise RecordingError(
            f"{path} has joint states of {counted(joints, 'joint')} ({counted(signals, 'value')} each), no "
            f"header line of column names: add one, such as {','.join(header)}"
        )
    return header


def _text_rows(path: Path, names: list[str], first: int, decimal: str, **form: Any) -> Table:
    """Rows of a text from line ``first`` on, under these names."""
    options: dict[str, Any] = {"header": None, "names": names, "index_col": False, **form}
    # All columns are read: with a choice of them pandas does not notice a line with too many fields.
    with warnings.catch_warnings(record=True) as messages:
        warnings.simplefilter("always")
        frame = pd.read_csv(
            path,
            decimal=decimal,
            skiprows=first - 1,
            skip_blank_lines=False,
            encoding_errors="replace",
            on_bad_lines="warn",
            **options,
        )
    if decimal == ",":  # pandas leaves a column as text where one field is no number
        texts = frame.select_dtypes(exclude="number")
        frame[texts.columns] = texts.astype(str).replace(",", ".", regex=True)
    matches = [match for message in messages for match in _SKIPPED.finditer(str(message.message))]
    skipped = [(int(m[1]), f"{counted(int(m[3]), 'field')}, expected {m[2]}") for m in matches]
    lines = np.arange(len(frame) + len(skipped)) + first  # people count the header as the first
    rows = np.setdiff1d(lines, [row for row, _ in skipped], assume_unique=True)[: len(frame)]
    return Table({name: frame.pop(name) for name in names}, rows, skipped)
