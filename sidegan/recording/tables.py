"""The contract of the file readers: a table of numbers that is read in pieces."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sidegan.errors import RecordingError

Numbers = NDArray[np.float64]
Where = dict[str, list[str]]  # columns of time and of every signal; a single column may hold all joints


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


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Turn what readers answer to a missing or foreign file into our error, with the reason."""
    try:
        yield
    except RecordingError:
        raise
    except Exception as error:  # a damaged file is answered with anything: of zip, SQLite, struct or YAML
        message = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        reason = (message.splitlines() or [""])[0] or type(error).__name__
        kind = path.suffix[1:] or "bag"
        raise RecordingError(f"{path} is not a whole {kind} file: {reason}") from error
