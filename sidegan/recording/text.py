"""Text files with a header line of column names, in common encodings and with common separators."""

import csv
import re
import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import islice, takewhile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from sidegan.base.names import counted, listed
from sidegan.errors import RecordingError
from sidegan.recording.tables import Table
from sidegan.recording.units import are_units

_SKIPPED = re.compile(r"line (\d+): expected (\d+) fields, saw (\d+)")
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d*,\d+([eE][+-]?\d+)?\s*")
_LOOKED_AT = 100  # lines from which separator and decimal mark are inferred
_SAMPLE = 1 << 16  # bytes from which the encoding is inferred
_MARKS = "#% "  # before comments and the headers that numpy writes
_STATE = ("position", "velocity", "effort")  # of a joint state, in its order


def text_table(path: Path) -> Table:
    """Table of a text file with columns separated by commas, semicolons, tabs or spaces.

    With semicolons or tabs, numbers may have decimal commas. The output of ``ros2 topic echo --csv`` for
    joint states needs no header.
    """
    encoding = _encoding_of(path)
    with path.open(encoding=encoding, errors="replace", newline="") as file:
        lines = list(islice(file, _LOOKED_AT))
    skipped = _comments(lines)
    lines = lines[skipped:]
    if not lines or not lines[0].strip():
        raise RecordingError(f"{path} is empty, or begins with a blank line, expected a header line")
    try:
        separator, decimal = _format_of(lines)
    except csv.Error:  # a field too long for any table
        separator = ""
    if not separator:
        raise RecordingError(
            f"{path} is no table: expected a line of column names, and below it a line of numbers for each "
            "sample, separated by commas, semicolons, tabs or spaces"
        )
    lines[0] = lines[0].lstrip(_MARKS).rstrip(" \r\n")
    names = _fields(lines[0], separator)
    blanks = separator == " " and _is_aligned(lines[1:], len(names))
    form = {"sep": r"\s+" if blanks else separator, "decimal": decimal, "encoding": encoding}
    if echoed := _echoed(path, names):
        return _text_rows(path, echoed, first=skipped + 1, **form)
    if all(_is_number(name.replace(decimal, ".")) for name in names):
        raise RecordingError(
            f"{path} begins with numbers, expected a header line of column names: add one, such as "
            "t,q1,q2,tau1,tau2"
        )
    names = [name or f"column {i + 1}" for i, name in enumerate(names)]
    if several := [repr(name) for name, count in Counter(names).items() if count > 1]:
        raise RecordingError(f"{path}: names of columns occur more than once: {listed(several)}")
    units = _fields(lines[1], separator) if lines[1:] else []
    stated = are_units(units)
    table = _text_rows(path, names, first=skipped + 2 + stated, **form)
    return replace(table, units=dict(zip(names, units))) if stated else table


def _fields(line: str, separator: str) -> list[str]:
    """Fields of a line, without quotes and blanks around them."""
    rows = csv.reader([line], delimiter=separator, skipinitialspace=True)
    return [field.strip() for field in next(rows, [])]


def _is_aligned(rows: Sequence[str], count: int) -> bool:
    """Whether blanks align rows of ``count`` fields; elsewhere two blanks have an empty field between."""
    padded = any(row[:1] == " " or "  " in row for row in rows)
    return padded and all(len(row.split()) == count for row in rows if row.strip())


def _comments(lines: Sequence[str]) -> int:
    """Number of lines before the header: comments, of which the last is the header if numbers follow."""
    marked = sum(1 for _ in takewhile(lambda line: line.startswith(tuple(_MARKS.strip())), lines))
    if marked in (0, len(lines)):
        return 0
    fields = [field for field in re.split(r"[;,\s]+", lines[marked]) if field]
    return marked - 1 if 2 * sum(map(_is_number, fields)) > len(fields) else marked


def _encoding_of(path: Path) -> str:
    """UTF-16 if there is a byte-order mark, UTF-8 if the text is valid, or else Windows-1252."""
    with path.open("rb") as file:
        sample = file.read(_SAMPLE)
    if sample.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    try:  # up to the last line break, so that no character is cut in two
        (sample.rpartition(b"\n")[0] or sample).decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


def _format_of(lines: Sequence[str]) -> tuple[str, str]:
    """Separator with which the rows hold the most numbers, and the decimal mark; empty if they hold none."""
    rows = lines[1:] or lines
    counts = {}
    for separator in ";\t, ":
        fields = [field for row in rows for field in _fields(row, separator)]
        commas = sum(_DECIMAL_COMMA.fullmatch(field) is not None for field in fields)
        points = [field for field in fields if _is_number(field)]
        comma = separator in ";\t" and commas and not any("." in field for field in points)
        counts[separator, "," if comma else "."] = len(points) + (commas if comma else 0)
    if lines[1:] and not any(counts.values()):
        return "", ""
    return max(counts, key=lambda form: (counts[form], lines[0].count(form[0])))


def _is_number(text: str) -> bool:
    """Whether a field is a number or NaN."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _echoed(path: Path, fields: Sequence[str]) -> list[str]:
    """Column names for joint states without a header; empty if the first line is not a joint state.

    Seconds, nanoseconds and frame are followed by the joints' names and values.
    """
    numbers = [_is_number(field) for field in fields]
    if len(fields) < 5 or not (fields[0].isdigit() and fields[1].isdigit()) or numbers[2] or numbers[3]:
        return []
    joints = numbers.index(True, 3) - 3 if any(numbers[3:]) else 0
    signals, rest = divmod(len(fields) - 3 - joints, joints or 1)
    if not joints or rest or not all(numbers[3 + joints :]):
        return []
    kinds = _STATE if signals == len(_STATE) else ("position", "effort")
    names = [f"{kind}_{k}" for kind in ("name", *kinds) for k in range(joints)]
    header = ["stamp.sec", "stamp.nanosec", "frame", *names]
    if signals != len(_STATE):
        raise RecordingError(
            f"{path} has joint states of {counted(joints, 'joint')} ({counted(signals, 'value')} each), no "
            f"header line of column names: add one, such as {','.join(header)}"
        )
    return header


def _text_rows(path: Path, names: list[str], first: int, decimal: str, **form: Any) -> Table:
    """Rows of a text from line ``first`` on, under these names."""
    options: dict[str, Any] = {"header": None, "names": names, "index_col": False, **form}
    # with usecols, pandas would not notice lines with too many fields
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
    if decimal == ",":  # pandas leaves a column as text if any field is not a number
        texts = frame.select_dtypes(exclude="number")
        frame[texts.columns] = texts.astype(str).replace(",", ".", regex=True)
    matches = [match for message in messages for match in _SKIPPED.finditer(str(message.message))]
    skipped = [(int(m[1]), f"{counted(int(m[3]), 'field')}, expected {m[2]}") for m in matches]
    lines = np.arange(len(frame) + len(skipped)) + first  # people count the header as the first
    rows = np.setdiff1d(lines, [row for row, _ in skipped], assume_unique=True)[: len(frame)]
    return Table({name: frame.pop(name) for name in names}, rows, skipped)
