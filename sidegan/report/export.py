"""Tables as files and on the terminal."""

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

import pandas as pd

from sidegan.base.storage import write_bytes

_NUMBER = re.compile(r"[\d\s.,:;±+−–—%×eE()/<>≤≥*-]*")  # cells that are aligned on the right
_LONGEST = 20  # letters of a word that a narrow table does not break
_FRAME = 3  # letters of a column's frame and padding; a row has one more
_PRINTED = 150  # letters of a line in a file or a pipe


class Recorder(Protocol):
    """Records results of a run, such as ``pipeline.tracking.Tracker``."""

    def log_table(self, table: pd.DataFrame, name: str) -> None:
        """Record a table."""

    def log_note(self, text: str) -> None:
        """Append Markdown to the run's description."""


def publish(table: pd.DataFrame, path: Path, caption: str, tracker: Recorder) -> None:
    """Print a table, write ``path``.csv and ``path``.md, and record both."""
    write_table(table, path, caption)
    show(table, caption)
    tracker.log_table(table, path.name)
    tracker.log_note(f"**{caption}**\n\n{markdown(table.reset_index())}")


def write_table(table: pd.DataFrame, path: Path, caption: str) -> None:
    """Write ``path``.csv and ``path``.md."""
    write_bytes(path.with_suffix(".csv"), table.reset_index().to_csv(index=False).encode())
    write_bytes(path.with_suffix(".md"), f"{caption}\n\n{markdown(table.reset_index())}\n".encode())


def markdown(table: pd.DataFrame) -> str:
    """A Markdown table without index; columns of numbers are aligned on the right."""
    text = _cells(table).map(lambda cell: " ".join(cell.replace("|", "\\|").splitlines()))
    rules = ["---:" if all(map(_NUMBER.fullmatch, text[name])) else "---" for name in text]
    rows = [[str(name).replace("|", "\\|") for name in text], rules, *text.to_numpy().tolist()]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def _cells(table: pd.DataFrame) -> pd.DataFrame:
    """Cells as text, with a dash for missing values."""
    return table.map(lambda cell: "—" if pd.isna(cell) else str(cell))


def show(table: pd.DataFrame, caption: str) -> None:
    """Print the table: standard output is for results, everything else goes to standard error.

    A table wider than the terminal is printed in parts, each with the rows' names.
    """
    from rich.console import Console
    from rich.table import Table

    width = None if sys.stdout.isatty() else _PRINTED
    console = Console(file=sys.stdout, width=width, markup=False)  # "[s]" is a unit, not a style
    console.print(caption, style="bold", soft_wrap=True, highlight=False)  # paths stay whole
    names = table.index.nlevels
    rows = _cells(table.reset_index())
    for widths in _parts(rows, names, console.width):
        drawn = Table()
        for i, wide in widths.items():
            name = str(rows.columns[i])
            drawn.add_column(name, justify="left" if i < names else "right", width=wide, overflow="fold")
        for row in rows.iloc[:, list(widths)].to_numpy().tolist():
            drawn.add_row(*row)
        console.print(drawn)


def _parts(rows: pd.DataFrame, names: int, width: int) -> Iterator[dict[int, int]]:
    """Columns of each part of a table, and their widths, to fit a terminal; names are in every part."""
    lines = [[line for cell in (str(name), *rows[name]) for line in cell.splitlines()] for name in rows]
    least = [min(_LONGEST, max(map(_unbroken, column), default=0)) for column in lines]
    most = [max(map(len, column), default=0) for column in lines]
    left = [*range(names, len(lines))]
    while left:
        shown = [*range(names), left.pop(0)]
        while left and sum(least[i] + _FRAME for i in [*shown, left[0]]) < width:
            shown.append(left.pop(0))
        widths = {i: most[i] for i in shown}
        while sum(wide + _FRAME for wide in widths.values()) >= width:
            widest = max(shown, key=lambda i: widths[i] - least[i])
            if widths[widest] == least[widest]:
                break
            widths[widest] -= 1
        yield widths


def _unbroken(line: str) -> int:
    """Letters of the longest part of a line that is not broken: a word, or a number with its spread."""
    return len(line) if _NUMBER.fullmatch(line) else max(map(len, line.split()), default=0)


def read_tables(text: str) -> list[pd.DataFrame]:
    """Tables of a Markdown text by ``markdown``: cells are text, or None for a dash."""
    tables = []
    for part in re.findall(r"(?:^\|.*\|\n)+", f"{text}\n", re.M):
        lines = [re.split(r"(?<!\\)\|", line)[1:-1] for line in part.splitlines()]
        header, _, *rows = ([cell.strip().replace("\\|", "|") for cell in line] for line in lines)
        tables.append(pd.DataFrame(rows, columns=header).replace({"—": None}))
    return tables
