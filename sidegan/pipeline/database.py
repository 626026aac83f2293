"""The SQLite database that MLflow makes in the outputs."""

import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any


@contextmanager
def made_at_once(database: Path) -> Iterator[None]:
    """What the block makes of an SQLite database reaches the disk at its end.

    MLflow makes a new one by repeating all changes of its history, and would wait for the disk after each.
    """
    from sqlalchemy import event
    from sqlalchemy.engine import Engine

    opened: list[Any] = []

    def hurry(connection: Any, record: Any) -> None:
        opened.append(connection)
        connection.execute("PRAGMA synchronous = OFF")

    event.listen(Engine, "connect", hurry)
    try:
        yield
    finally:
        event.remove(Engine, "connect", hurry)
        for connection in opened:
            with suppress(sqlite3.Error):  # closed meanwhile
                connection.execute("PRAGMA synchronous = FULL")
    with database.open("rb") as file:
        os.fsync(file.fileno())
