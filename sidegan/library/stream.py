"""Libraries larger than memory: written part by part, their diagonals and single rows read from the file."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from sidegan.base.storage import opened_parquet, replacing
from sidegan.errors import ArtifactError, ShapeError
from sidegan.library.collection import Library
from sidegan.library.parquet import METADATA_KEY, OPTIONS, content_of

if TYPE_CHECKING:  # slow to import, and `--help` must not wait for it
    import pyarrow.parquet as pq


def save_parts(path: Path, parts: Iterable[Library]) -> int:
    """Number of trajectories written to one Parquet file, a row group per part, whole or not at all.

    ``Library.load`` reads the file like any other, where memory suffices.

    Raises:
        ShapeError: when there is no trajectory, or two parts differ in anything of ``Library.family``.
    """
    import pyarrow.parquet as pq

    rest = (part for part in parts if len(part))
    first = next(rest, None)
    if first is None:
        raise ShapeError("an empty library cannot be saved")
    options, table, count = {**OPTIONS, "write_page_checksum": True}, first.table(), len(first)
    with replacing(path) as neighbour, pq.ParquetWriter(neighbour, table.schema, **options) as writer:
        writer.write_table(table)
        for part in rest:
            if part.family() != first.family():
                raise ShapeError(f"parts of a library differ: {first.family()} and {part.family()}")
            writer.write_table(part.table())
            count += len(part)
    return count


class Diagonals(Sequence[Tensor]):
    """Diagonals of YᵀY / T of a library's file, (N_k, p) for each of its row groups, read when needed."""

    def __init__(self, path: Path) -> None:
        self.path = path
        with _opened(path) as file:
            self._metadata, self._groups = file.metadata, file.num_row_groups

    def __len__(self) -> int:
        return self._groups

    def __getitem__(self, index: int) -> Tensor:  # type: ignore[override]
        if not 0 <= index < self._groups:
            raise IndexError(f"row group {index} of {self._groups}")
        with _opened(self.path, self._metadata) as file:
            column = file.read_row_group(index, columns=["diagonal"])["diagonal"].combine_chunks()
        values = np.array(column.flatten().to_numpy(zero_copy_only=False))
        return torch.from_numpy(values).reshape(len(column), -1)


def take(path: Path, indices: Tensor | Sequence[int]) -> Library:
    """The trajectories at ``indices``, (K,), of a library's file, in that order; one row group at a time."""
    index = torch.as_tensor(indices, dtype=torch.long).reshape(-1)
    parts: list[Library] = []
    order: list[Tensor] = []
    start = 0
    with _opened(path) as file:
        for group in range(file.num_row_groups):
            count = file.metadata.row_group(group).num_rows
            here = ((index >= start) & (index < start + count)).nonzero()[:, 0]
            if len(here):
                rows = file.read_row_group(group).take((index[here] - start).numpy())
                parts.append(Library.of(path, content_of(path, rows)))
                order.append(here)
            start += count
    outside = index[(index < 0) | (index >= start)]
    if len(outside) or not len(index):
        which = f"index {int(outside[0])} is outside" if len(outside) else "no index was given for"
        raise ShapeError(f"{which} a library of {start} trajectories")
    return parts[0].merge(*parts[1:]).take(torch.cat(order).argsort())


@contextmanager
def _opened(path: Path, metadata: "pq.FileMetaData | None" = None) -> "Iterator[pq.ParquetFile]":
    with opened_parquet(path, metadata) as file:
        if METADATA_KEY not in (file.schema_arrow.metadata or {}) or not file.metadata.num_rows:
            raise ArtifactError(f"{path} is not a library of sidegan that holds trajectories")
        yield file
