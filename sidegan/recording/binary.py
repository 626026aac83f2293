"""Parquet and NPZ files in pieces."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from sidegan.errors import RecordingError
from sidegan.recording.tables import Numbers, Piece, Table, reading

if TYPE_CHECKING:
    import pyarrow as pa

_BUFFER = 2**20  # bytes


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
    with reading(path), pq.ParquetFile(path, buffer_size=_BUFFER, pre_buffer=False) as file:
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
    with reading(path), np.load(path, allow_pickle=False) as file:
        arrays = {name: np.asarray(file[name], dtype=np.float64) for name in columns}
    lengths = {name: len(x) if x.ndim else 0 for name, x in arrays.items()}
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{name} has {n}" for name, n in lengths.items())
        raise RecordingError(f"{path}: the arrays are not of the same length: {listed}")
    count = max(lengths.values())
    for first in range(0, count, rows):
        piece = {name: x[first : first + rows] for name, x in arrays.items()}
        yield Piece(piece, np.arange(first, min(first + rows, count)) + 1)
