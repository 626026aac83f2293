"""From a file to recordings in SI units, in pieces of bounded memory."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from sidegan.base.names import counted, listed
from sidegan.base.storage import reading
from sidegan.errors import RecordingError
from sidegan.recording.bags import bag_files, bag_pieces, is_bag
from sidegan.recording.columns import columns_of
from sidegan.recording.joints import Joints, header_of, joints_of
from sidegan.recording.lerobot import dataset_files, dataset_table, is_dataset
from sidegan.recording.merged import Track, merged
from sidegan.recording.recording import Recording
from sidegan.recording.settings import SIGNALS, Columns, Files, Recorded, paths_of
from sidegan.recording.tables import Numbers, Piece, Where, npz_table, parquet_table, text_table

_ROWS = 65_536  # at once; of 29 columns: 15 MB
_MOST_CORRUPT = 0.5  # of the rows of a piece
_LEAST_JUDGED = 1000  # rows of a piece that is judged by itself; a file may end in a few broken ones
_FIRST_ROW = 2  # number of the first row, after the header
_MOST_KEPT = 800_000_000  # bytes of a bag that are kept for the next walk: bags are read slowly
_LARGEST = 1e12  # of any signal in SI units, and of a time: what is larger is no measurement
_LISTED = 8  # columns that a refusal names
_OF_SECONDS = np.array([1.0, 1e-9])  # seconds, and nanoseconds in a column of their own
_READERS = {
    **dict.fromkeys((".csv", ".tsv", ".txt"), text_table),
    **dict.fromkeys((".parquet", ".pq"), parquet_table),
    ".npz": npz_table,
}


@dataclass(frozen=True)
class Source:
    """A recording that can be read in pieces, as often as needed, from a file or from one for each signal."""

    # CSV (first line: column names), Parquet, NPZ, ROS 2 bag (folder, .db3, .mcap), LeRobot dataset (folder)
    files: Recorded | Path
    columns: Columns  # where they keep what, and in which units
    joint_names: tuple[str, ...]  # of the arm
    rows: int = _ROWS  # most samples per piece
    chain: tuple[str, ...] | None = None  # these and the names of joints locked between them; null: no others
    remarks: list[str] = field(
        default_factory=list, init=False, repr=False, compare=False
    )  # once it was read
    _kept: list[Recording] = field(default_factory=list, init=False, repr=False, compare=False)

    @property
    def name(self) -> str:
        """The file's name; of several, the first one's."""
        return listed([Path(path).name for path in paths_of(self.files)], 1)

    def __iter__(self) -> Iterator[Recording]:
        """Consecutive pieces of the recording; what comes in several files is read as a whole first.

        Raises:
            RecordingError: when a file cannot be read or does not fit the arm.
        """
        if self._kept:
            yield from self._kept
            return
        self.remarks.clear()
        files = self.files
        slow = isinstance(files, Files) or is_bag(Path(files))
        read, size = [], 0
        for part in self._merged(files) if isinstance(files, Files) else self._whole(Path(files)):
            size += sum(x.nbytes for x in (part.time, *part.signals().values())) if slow else _MOST_KEPT
            if size < _MOST_KEPT:
                read.append(part)
            yield part
        self._kept.extend(read if size < _MOST_KEPT else [])

    def _whole(self, path: Path) -> Iterator[Recording]:
        """Pieces of a file that holds all signals."""
        pieces, where = self._open(path)
        for piece in pieces:
            signals, corrupt = self._numbers(path.name, piece, where)
            yield self._recording(signals, (*piece.skipped, *corrupt))

    def _merged(self, files: Files) -> Iterator[Recording]:
        """Pieces of files that hold a signal each."""
        if self.columns.header is not None:
            raise RecordingError(
                f"{self.name}: recording.header is of one file with all signals; give each of these a first "
                "line of column names"
            )
        wanted = files.signals(self.columns.effort).items()
        parts = [self._track(Path(path), signal) for signal, path in wanted if getattr(self.columns, signal)]
        time, values, remarks = merged([track for track, _ in parts])
        self.remarks.extend(remarks)
        corrupt = [row for _, rows in parts for row in rows]
        for first in range(0, len(time), self.rows):
            some = slice(first, first + self.rows)
            signals = {"time": time[some], **{name: x[some] for name, x in values.items()}}
            yield self._recording(signals, corrupt if first == 0 else [])

    def _track(self, path: Path, signal: str) -> tuple[Track, list[tuple[int, str]]]:
        """A file's one signal, and its corrupt rows."""
        pieces, where = self._open(path, signal)
        parts, corrupt = [], []
        for piece in pieces:
            signals, bad = self._numbers(path.name, piece, where)
            parts.append(signals)
            corrupt += [(row, f"{path.name}: {reason}") for row, reason in (*piece.skipped, *bad)]
        time, values = (np.concatenate([part[name] for part in parts]) for name in ("time", signal))
        if not len(time):
            raise RecordingError(f"{path.name} holds no samples")
        return Track(path.name, signal, time, values, "time" in where), corrupt

    def _recording(self, signals: dict[str, Numbers], corrupt: Sequence[tuple[int, str]]) -> Recording:
        tensors = {name: torch.from_numpy(np.ascontiguousarray(x)) for name, x in signals.items()}
        return Recording(self.name, self.joint_names, corrupt=tuple(corrupt), **tensors)

    def _open(self, path: Path, only: str | None = None) -> tuple[Iterator[Piece], Where]:
        """Pieces of a file, and which of their columns is which signal, or the only one of interest."""
        with reading(path, "recording", RecordingError):
            if not path.exists():
                raise RecordingError(f"there is no recording {path}")
            files_of(path)
        suffix = path.suffix.lower()
        joints = joints_of(path.name, self.columns, self.joint_names, self.chain)
        header = None if self.columns.header is None else header_of(self.columns.header, joints)
        if header is not None and _READERS.get(suffix) is not text_table:
            raise RecordingError(f"{path} is no text without names of its columns: no recording.header")
        if is_bag(path) and not is_dataset(path):
            return _of_bag(path, self.columns, joints, self.rows, only)
        if not is_dataset(path) and suffix not in _READERS:
            raise RecordingError(
                f"{path} ends in {suffix or 'nothing'}, expected {', '.join(_READERS)} or a bag"
            )
        with reading(path, suffix[1:], RecordingError):
            reader = dataset_table if is_dataset(path) else _READERS[suffix]
            table = (reader if header is None else partial(text_table, header=header))(path, self.rows)
        found = columns_of(path.name, table, self.columns, joints, only)
        self.remarks.extend(f"{path.name}: {remark}" if only else remark for remark in found.remarks)
        return table.pieces([c for columns in found.where.values() for c in columns]), found.where

    def _numbers(
        self, file: str, piece: Piece, where: Where
    ) -> tuple[dict[str, Numbers], list[tuple[int, str]]]:
        """Time (S,) and signals (S, J) of a piece in SI units without its corrupt rows, and those."""
        joints, units = len(self.joint_names), self.columns.units
        signals: dict[str, Numbers] = {}
        if "time" not in where:
            signals["time"] = piece.rows / (self.columns.rate or 1.0)
        for name in (one for one in ("time", *SIGNALS) if one in where):
            parts = [piece.columns[c] for c in where[name]]
            if len(parts) > 1 and any(part.ndim > 1 for part in parts):
                raise RecordingError(f"{file}: {where[name][0]!r} holds more than a number in each row")
            x = parts[0] if len(parts) == 1 else np.stack(parts, 1)
            if name == "time" and len(parts) > 1:
                x = x @ _OF_SECONDS / units.factor("time")
            if name != "time":
                x = x[:, None] if x.ndim == 1 else x
                if x.shape[1:] != (joints,):
                    raise RecordingError(
                        f"{file}: {where[name][0]!r} is {x.shape}, the arm has {counted(joints, 'joint')}"
                    )
            signals[name] = x * units.factor(name)
        good, corrupt = _finite_rows(file, piece, where, signals)
        return {name: x[good] for name, x in signals.items()}, corrupt


def _of_bag(
    path: Path, columns: Columns, joints: Joints, rows: int, only: str | None
) -> tuple[Iterator[Piece], Where]:
    """Pieces of a bag, and where the signals are, or the only one of interest."""
    pieces, where = bag_pieces(path, columns, joints.names, rows)
    if only and only not in where:
        raise RecordingError(f"{path.name}: its joint states have no {only}, but {', '.join([*where][1:])}")
    return pieces, {name: where[name] for name in ("time", only)} if only else where


def files_of(path: Path) -> list[Path]:
    """The files of a recording: itself, or those of a folder.

    Raises:
        RecordingError: when the folder is neither a bag nor a dataset.
    """
    if not path.is_dir():
        return [path]
    return dataset_files(path) if is_dataset(path) else bag_files(path)


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
