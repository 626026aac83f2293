"""From files to recordings in SI units."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from sidegan.base.names import counted, listed
from sidegan.base.storage import reading
from sidegan.errors import RecordingError
from sidegan.recording.bags import bag_files, bag_rows, is_bag
from sidegan.recording.columns import Joints, columns_of
from sidegan.recording.lerobot import dataset_files, dataset_table, is_dataset
from sidegan.recording.merged import Part, merged
from sidegan.recording.recording import Recording
from sidegan.recording.settings import SIGNALS, Columns, Files, Recorded, paths_of
from sidegan.recording.tables import Numbers, Rows, Where, npz_table, parquet_table, text_table

_MOST_CORRUPT = 0.5  # of the rows of a file
_LARGEST = 1e12  # of any signal in SI units, and of a time: what is larger is no measurement
_LISTED = 8  # columns that a refusal names
_OF_SECONDS = np.array([1.0, 1e-9])  # seconds, and nanoseconds in a column of their own
_TEXTS = (".csv", ".tsv", ".txt")
_READERS = {
    **dict.fromkeys(_TEXTS, text_table),
    **dict.fromkeys((".parquet", ".pq"), parquet_table),
    ".npz": npz_table,
}


def load_recording(
    files: Recorded | Path, columns: Columns, joint_names: Sequence[str], chain: Sequence[str] | None = None
) -> Recording:
    """A recording of an arm's joints, from a file or from one for each signal.

    Args:
        files: CSV (first line: column names), Parquet, NPZ, ROS 2 bag (folder, .db3, .mcap), LeRobot dataset
            (folder), or several of them.
        columns: where they keep what, and in which units.
        joint_names: of the arm.
        chain: these and the names of joints locked between them, from the base outwards; None: no others.

    Raises:
        RecordingError: when a file cannot be read or does not fit the arm.
    """
    name = recording_name(files)
    if isinstance(files, Files):
        if columns.header is not None:
            raise RecordingError(
                f"{name}: recording.header is of one file with all signals; give each of these a first line "
                "of column names"
            )
        wanted = files.signals(columns.effort).items()
        read = [
            _read(Path(path), columns, joint_names, chain, signal)
            for signal, path in wanted
            if getattr(columns, signal)
        ]
        signals, corrupt, remarks = merged(read)
    else:
        _, _, signals, corrupt, remarks = _read(Path(files), columns, joint_names, chain)
    tensors: dict[str, Any] = {key: torch.from_numpy(np.ascontiguousarray(x)) for key, x in signals.items()}
    return Recording(name, tuple(joint_names), corrupt=tuple(corrupt), remarks=tuple(remarks), **tensors)


def recording_name(files: Recorded | Path) -> str:
    """The file's name; of several, the first one's."""
    return listed([Path(path).name for path in paths_of(files)], 1)


def _read(
    path: Path,
    columns: Columns,
    joint_names: Sequence[str],
    chain: Sequence[str] | None,
    only: str | None = None,
) -> Part:
    """The signals of a file, or the only one of interest, without rows that lack a number."""
    rows, where, remarks = _open(path, columns, Joints.of(path.name, columns, joint_names, chain), only)
    signals = _in_si(path.name, rows, where, columns, len(joint_names))
    good, corrupt = _whole_rows(path.name, rows, where, signals)
    if not good.any():
        raise RecordingError(f"{path.name} holds no samples")
    kept = {name: x[good] for name, x in signals.items()}
    return Part(path.name, "time" in where, kept, [*rows.skipped, *corrupt], remarks)


def _open(path: Path, columns: Columns, joints: Joints, only: str | None) -> tuple[Rows, Where, list[str]]:
    """Rows of a file, which of their columns is which signal, and remarks on that."""
    with reading(path, "recording", RecordingError):
        if not path.exists():
            raise RecordingError(f"there is no recording {path}")
        files_of(path)
    suffix, dataset = path.suffix.lower(), is_dataset(path)
    if columns.header is not None and suffix not in _TEXTS:
        raise RecordingError(f"{path} is no text without names of its columns: no recording.header")
    if is_bag(path) and not dataset:
        rows, where = bag_rows(path, columns, joints.names)
        if only and only not in where:
            raise RecordingError(
                f"{path.name}: its joint states have no {only}, but {', '.join([*where][1:])}"
            )
        return rows, {name: where[name] for name in ("time", only)} if only else where, []
    if not dataset and suffix not in _READERS:
        raise RecordingError(f"{path} ends in {suffix or 'nothing'}, expected {', '.join(_READERS)} or a bag")
    with reading(path, suffix[1:], RecordingError):
        if columns.header is not None:
            table = text_table(path, joints.header(columns.header))
        else:
            table = dataset_table(path) if dataset else _READERS[suffix](path)
    where, remarks = columns_of(path.name, table, columns, joints, only)
    return table.read([c for some in where.values() for c in some]), where, remarks


def files_of(path: Path) -> list[Path]:
    """The files of a recording: itself, or those of a folder.

    Raises:
        RecordingError: when the folder is neither a bag nor a dataset.
    """
    if not path.is_dir():
        return [path]
    return dataset_files(path) if is_dataset(path) else bag_files(path)


def _in_si(file: str, rows: Rows, where: Where, columns: Columns, joints: int) -> dict[str, Numbers]:
    """Time (S,) and signals (S, J) in SI units."""
    signals: dict[str, Numbers] = {}
    if "time" not in where:
        signals["time"] = rows.numbers / (columns.rate or 1.0)
    for name in (one for one in ("time", *SIGNALS) if one in where):
        parts = [rows.columns[c] for c in where[name]]
        if len(parts) > 1 and any(part.ndim > 1 for part in parts):
            raise RecordingError(f"{file}: {where[name][0]!r} holds more than a number in each row")
        x = parts[0] if len(parts) == 1 else np.stack(parts, 1)
        if name == "time" and len(parts) > 1:
            x = x @ _OF_SECONDS / columns.units.factor("time")
        if name != "time":
            x = x[:, None] if x.ndim == 1 else x
            if x.shape[1:] != (joints,):
                raise RecordingError(
                    f"{file}: {where[name][0]!r} is {x.shape}, the arm has {counted(joints, 'joint')}"
                )
        signals[name] = x * columns.units.factor(name)
    return signals


def _whole_rows(
    file: str, rows: Rows, where: Where, signals: dict[str, Numbers]
) -> tuple[NDArray[np.bool_], list[tuple[int, str]]]:
    """Which rows hold a number in every column, and the number and reason of the others."""
    flat = {name: x[:, None] if x.ndim == 1 else x for name, x in signals.items() if name in where}
    bad = ~(np.abs(np.concatenate([*flat.values()], 1)) <= _LARGEST)
    names = [
        where[name][k] if len(where[name]) > 1 or x.shape[1] == 1 else f"{where[name][0]}[{k}]"
        for name, x in flat.items()
        for k in range(x.shape[1])
    ]
    wrong = np.asarray(bad.any(1))
    if len(wrong) and wrong.mean() > _MOST_CORRUPT:
        worst = [name for name, share in zip(names, bad.mean(0)) if share > _MOST_CORRUPT / len(names)]
        raise RecordingError(
            f"{file}: {wrong.mean():.0%} of its rows are without a number, in column "
            f"{', '.join(worst[:_LISTED])}"
        )
    lacking = [[name for name, is_bad in zip(names, bad[k]) if is_bad] for k in np.flatnonzero(wrong)]
    reasons = [f"no number in {', '.join(some[:3])}{' …' if len(some) > 3 else ''}" for some in lacking]
    return ~wrong, [*zip(rows.numbers[wrong].tolist(), reasons)]
