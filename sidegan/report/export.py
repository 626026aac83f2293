"""Tables as files and on the terminal."""

import re
import shutil
import sys
from pathlib import Path
from typing import Protocol

import pandas as pd

from sidegan.base.storage import write_bytes

_NUMBER = re.compile(r"[\d\s.,:;±+−–—%×eE()/<>≤≥*-]*")  # cells that are aligned on the right
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
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else _PRINTED
    cells = _cells(table).map(lambda cell: " ".join(cell.split()))
    sys.stdout.write(f"{caption}\n{cells.to_string(line_width=width)}\n\n")


def read_tables(text: str) -> list[pd.DataFrame]:
    """Tables of a Markdown text by ``markdown``: cells are text, or None for a dash."""
    tables = []
    for part in re.findall(r"(?:^\|.*\|\n)+", f"{text}\n", re.M):
        header, _, *rows = ([cell.strip() for cell in line[1:-1].split("|")] for line in part.splitlines())
        tables.append(pd.DataFrame(rows, columns=header).replace({"—": None}))
    return tables
