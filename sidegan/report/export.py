"""Tables as files and on the terminal."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from sidegan.base.storage import write_bytes

if TYPE_CHECKING:
    from sidegan.pipeline.tracking import Tracker


def publish(table: pd.DataFrame, path: Path, caption: str, tracker: "Tracker") -> None:
    """Print a table, write ``path``.csv and ``path``.md, and record both."""
    write_table(table, path, caption)
    show(table, caption)
    tracker.log_table(table, path.name)
    for suffix in (".csv", ".md"):
        tracker.log_artifact(path.with_suffix(suffix), "tables")


def write_table(table: pd.DataFrame, path: Path, caption: str) -> None:
    """Write ``path``.csv and ``path``.md."""
    flat = table.reset_index()
    write_bytes(path.with_suffix(".csv"), flat.to_csv(index=False).encode())
    write_bytes(path.with_suffix(".md"), f"{caption}\n\n{markdown(flat)}\n".encode())


def markdown(flat: pd.DataFrame) -> str:
    """A Markdown table."""
    rows = [list(map(str, flat.columns)), ["---"] * len(flat.columns), *flat.astype(str).values.tolist()]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows)


def show(table: pd.DataFrame, caption: str) -> None:
    """Print the table: standard output is for results, everything else goes to standard error."""
    from rich.console import Console
    from rich.table import Table

    flat = table.reset_index()
    drawn = Table(title=caption, title_justify="left", title_style="bold")
    for i, column in enumerate(flat.columns):
        drawn.add_column(str(column), justify="left" if i == 0 else "right", overflow="fold")
    for row in flat.astype(str).values.tolist():
        drawn.add_row(*row)
    width = None if sys.stdout.isatty() else 150
    Console(file=sys.stdout, width=width, markup=False).print(drawn)  # "[s]" is a unit and no style
