"""From a file to recordings in SI units, in pieces of bounded memory."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from sidegan.base.storage import reading
from sidegan.errors import RecordingError
from sidegan.recording.bags import bag_files, bag_pieces, is_bag
from sidegan.recording.lerobot import dataset_files, dataset_table, is_dataset
from sidegan.recording.recording import Recording
from sidegan.recording.settings import SIGNALS, Columns
from sidegan.recording.tables import Numbers, Piece, Where, npz_table, parquet_table, text_table

_ROWS = 65_536  # at once; of 29 columns: 15 MB
_MOST_CORRUPT = 0.5  # of the rows of a piece
_LEAST_JUDGED = 1000  # rows of a piece that is judged by itself; a file may end in a few broken ones
_FIRST_ROW = 2  # number of the first row, after the header
_MOST_KEPT = 800_000_000  # bytes of a bag that are kept for the next walk: bags are read slowly
_LARGEST = 1e12  # of any signal in SI units, and of a time: what is larger is no measurement
_LISTED = 8  # columns that a refusal names
_READERS = {
    **dict.fromkeys((".csv", ".tsv", ".txt"), text_table),
    **dict.fromkeys((".parquet", ".pq"), parquet_table),
    ".npz": npz_table,
}


@dataclass(frozen=True)
class Source:
    """A recorded file that can be read in pieces, as often as needed."""

    # CSV (first line: column names), Parquet, NPZ, ROS 2 bag (folder, .db3, .mcap), LeRobot dataset (folder)
    path: Path
    columns: Columns  # where it keeps what, and in which units
    joint_names: tuple[str, ...]  # of the arm
    rows: int = _ROWS  # most samples per piece
    _kept: list[Recording] = field(default_factory=list, init=False, repr=False, compare=False)

    @property
    def name(self) -> str:
        """The file's name."""
        return self.path.name

    def __iter__(self) -> Iterator[Recording]:
        """Consecutive pieces of the recording.

        Raises:
            RecordingError: when the file cannot be read or does not fit the arm.
        """
        if self._kept:
            yield from self._kept
            return
        pieces, where = self._open()
        read, size = [], 0
        for piece in pieces:
            part = _recording(self, piece, where)
            size += sum(x.nbytes for x in piece.columns.values()) if is_bag(self.path) else _MOST_KEPT
            if size < _MOST_KEPT:
                read.append(part)
            yield part
        self._kept.extend(read if size < _MOST_KEPT else [])

    def _open(self) -> tuple[Iterator[Piece], Where]:
        """Pieces of the file, and which of their columns is which signal."""
        with reading(self.path, "recording", RecordingError):
            if not self.path.exists():
                raise RecordingError(f"there is no recording {self.path}")
            files_of(self.path)
        suffix = self.path.suffix.lower()
        header = self.columns.named(self.name, self.joint_names)
        if header is not None and _READERS.get(suffix) is not text_table:
            raise RecordingError(f"{self.path} is no text without names of its columns: no recording.header")
        if is_dataset(self.path):
            table = dataset_table(self.path, self.rows)
            where = self.columns.resolve(self.name, table.columns, self.joint_names)
            return table.pieces([c for columns in where.values() for c in columns]), where
        if is_bag(self.path):
            return bag_pieces(self.path, self.columns, self.joint_names, self.rows)
        if suffix not in _READERS:
            raise RecordingError(
                f"{self.path} ends in {suffix or 'nothing'}, expected {', '.join(_READERS)} or a bag"
            )
        with reading(self.path, suffix[1:], RecordingError):
            reader = _READERS[suffix] if header is None else partial(text_table, header=header)
            table = reader(self.path, self.rows)
        where = self.columns.resolve(self.name, table.columns, self.joint_names)
        return table.pieces([c for columns in where.values() for c in columns]), where


def files_of(path: Path) -> list[Path]:
    """The files of a recording: itself, or those of a folder.

    Raises:
        RecordingError: when the folder is neither a bag nor a dataset.
    """
    if not path.is_dir():
        return [path]
    return dataset_files(path) if is_dataset(path) else bag_files(path)


def _recording(source: Source, piece: Piece, where: Where) -> Recording:
    """A piece in SI units without its corrupt rows."""
    joints, units = len(source.joint_names), source.columns.units
    signals: dict[str, Numbers] = {}
    if "time" not in where:
        signals["time"] = piece.rows / (source.columns.rate or 1.0)
    for name in (one for one in ("time", *SIGNALS) if one in where):
        parts = [piece.columns[c] for c in where[name]]
        if len(parts) > 1 and any(part.ndim > 1 for part in parts):
            raise RecordingError(f"{source.name}: {where[name][0]!r} holds more than a number in each row")
        x = parts[0] if len(parts) == 1 else np.stack(parts, 1)
        if name != "time":
            x = x[:, None] if x.ndim == 1 else x
            if x.shape[1:] != (joints,):
                raise RecordingError(
                    f"{source.name}: {where[name][0]!r} is {x.shape}, the arm has {joints} joints"
                )
        signals[name] = x * units.factor(name)
    good, corrupt = _finite_rows(source.name, piece, where, signals)
    tensors = {name: torch.from_numpy(x[good]) for name, x in signals.items()}
    return Recording(source.name, source.joint_names, corrupt=(*piece.skipped, *corrupt), **tensors)


def _finite_rows(
    file: str, piece: Piece, where: Where, signals: dict[str, Numbers]
) -> tuple[NDArray[np.bool_], list[tuple[int, str]]]:
    """Which rows hold a number in every column, and the row and reason of the others."""
    flat = {name: x[:, None] if x.ndim == 1 else x for name, x in signals.items()}
    bad = ~(np.abs(np.concatenate([x for name, x in flat.items() if name in where], 1)) <= _LARGEST)
    names = [
        where[name][k] if len(where[name]) > 1 or x.shape[1] == 1 else f"{where[name][0]}[{k}]"
        for name, x in flat.items()
        if name in where
        for k in range(x.shape[1])
    ]
    wrong = np.asarray(bad.any(1))
    judged = len(wrong) >= _LEAST_JUDGED or (len(wrong) > 0 and piece.rows[0] <= _FIRST_ROW)
    if judged and wrong.mean() > _MOST_CORRUPT:
        worst = [name for name, share in zip(names, bad.mean(0)) if share > _MOST_CORRUPT / len(names)]
        raise RecordingError(
            f"{file}: {wrong.mean():.0%} of rows {piece.rows[0]} to {piece.rows[-1]} are without a number, "
            f"in column {', '.join(worst[:_LISTED])}"
        )
    corrupt = []
    for k in np.flatnonzero(wrong):
        lacking = [name for name, is_bad in zip(names, bad[k]) if is_bad]
        listed = ", ".join(lacking[:3]) + (" …" if len(lacking) > 3 else "")
        corrupt.append((int(piece.rows[k]), f"no number in {listed}"))
    return ~wrong, corrupt
