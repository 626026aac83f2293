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
from sidegan.recording.bags import bag_files, bag_table, is_bag
from sidegan.recording.columns import Finder, Joints
from sidegan.recording.lerobot import dataset_files, dataset_table, is_dataset
from sidegan.recording.merged import Part, merged
from sidegan.recording.recording import Recording
from sidegan.recording.settings import Files, Recorded, RecordingSettings, paths_of
from sidegan.recording.tables import Numbers, Table, Where, npz_table, parquet_table, text_table

_MOST_CORRUPT = 0.5  # of the rows of a file
_LARGEST = 1e12  # of any signal in SI units, and of a time: what is larger is no measurement
_OF_SECONDS = np.array([1.0, 1e-9])  # seconds, and nanoseconds in a column of their own
_READERS = {
    **dict.fromkeys((".csv", ".tsv", ".txt"), text_table),
    **dict.fromkeys((".parquet", ".pq"), parquet_table),
    ".npz": npz_table,
}


def load_recording(
    files: Recorded | Path, settings: RecordingSettings, joint_names: Sequence[str], chain: Sequence[str] = ()
) -> Recording:
    """A recording of an arm's joints, from a file or from one for each signal.

    It is CSV (first line: column names), Parquet, NPZ, a ROS 2 bag (folder, .db3, .mcap) or a LeRobot dataset
    (folder). The chain are the names of the arm's joints and of those locked between them, from the base
    outwards; no names: no others.

    Raises:
        RecordingError: when a file cannot be read or does not fit the arm.
    """
    name = recording_name(files)
    joints = Joints.of(name, settings, joint_names, chain)
    if not isinstance(files, Files):
        part = _read(Path(files), settings, joints)
        signals, corrupt, remarks = part.signals, part.corrupt, part.remarks
    else:
        wanted = [(k, path) for k, path in files.signals(settings.effort).items() if getattr(settings, k)]
        signals, corrupt, remarks = merged([_read(Path(path), settings, joints, k) for k, path in wanted])
    tensors: dict[str, Any] = {key: torch.from_numpy(np.ascontiguousarray(x)) for key, x in signals.items()}
    return Recording(name, tuple(joint_names), corrupt=tuple(corrupt), remarks=tuple(remarks), **tensors)


def recording_name(files: Recorded | Path) -> str:
    """The file's name; of several, the first one's."""
    return listed([Path(path).name for path in paths_of(files)], 1)


def files_of(path: Path) -> list[Path]:
    """The files of a recording: itself, or those of a folder.

    Raises:
        RecordingError: when the folder is neither a bag nor a dataset.
    """
    if not path.is_dir():
        return [path]
    return dataset_files(path) if is_dataset(path) else bag_files(path)


def _read(path: Path, settings: RecordingSettings, joints: Joints, only: str | None = None) -> Part:
    """The signals of a file, or the only one of interest, without rows that lack a number."""
    with reading(path, "recording", RecordingError):
        if not path.exists():
            raise RecordingError(f"there is no recording {path}")
        files_of(path)
    table, where, remarks = _open(path, settings, joints, only)
    with reading(path, path.suffix[1:], RecordingError):
        signals = {name: _in_si(path.name, table, name, where[name], settings) for name in where}
    _refuse_shapes(path.name, signals, where, len(joints.own))
    good, corrupt = _whole_rows(path.name, table.rows, where, signals)
    if not good.any():
        raise RecordingError(f"{path.name} holds no samples")
    kept = {name: x[good] for name, x in signals.items()}
    kept["time"] = kept["time"][:, 0] if "time" in where else table.rows[good] / (settings.rate or 1.0)
    return Part(path.name, "time" in where, kept, [*table.skipped, *corrupt], remarks)


def _open(
    path: Path, settings: RecordingSettings, joints: Joints, only: str | None
) -> tuple[Table, Where, list[str]]:
    """A file's table, which of its columns is which signal, and remarks on that."""
    suffix, dataset = path.suffix.lower(), is_dataset(path)
    if is_bag(path) and not dataset:
        table, where = bag_table(path, settings, joints.names)
        if only and only not in where:
            raise RecordingError(
                f"{path.name}: its joint states have no {only}, but {', '.join([*where][1:])}"
            )
        return table, {name: where[name] for name in ("time", only)} if only else where, []
    if not dataset and suffix not in _READERS:
        raise RecordingError(f"{path} ends in {suffix or 'nothing'}, expected {', '.join(_READERS)} or a bag")
    with reading(path, suffix[1:], RecordingError):
        table = dataset_table(path) if dataset else _READERS[suffix](path)
    return table, *Finder(path.name, table, settings, joints, only).found()


def _in_si(file: str, table: Table, name: str, where: Sequence[str], settings: RecordingSettings) -> Numbers:
    """Time (S, 1) or a signal (S, J) in SI units."""
    parts = [table.numbers(column) for column in where]
    if len({len(x) for x in parts}) > 1 or any(x.ndim > 2 for x in parts):
        shapes = ", ".join(f"{column} is {x.shape}" for column, x in zip(where, parts))
        raise RecordingError(f"{file}: columns are not of one length with a number in each row: {shapes}")
    x = np.column_stack(parts)
    if name == "time" and len(parts) > 1:
        x = x @ _OF_SECONDS[:, None] / settings.units.factor("time")
    return x * settings.units.factor(name)


def _refuse_shapes(file: str, signals: dict[str, Numbers], where: Where, joints: int) -> None:
    """Refuse arrays that are not of one length, or have not an element for each joint."""
    if len({len(x) for x in signals.values()}) > 1:
        lengths = ", ".join(f"{where[name][0]} has {len(x)}" for name, x in signals.items())
        raise RecordingError(f"{file}: the arrays are not of the same length: {lengths}")
    for name, x in signals.items():
        if name != "time" and x.shape[1] != joints:
            arm = f"the arm has {counted(joints, 'joint')}"
            raise RecordingError(f"{file}: {where[name][0]!r} is {x.shape}, {arm}")


def _whole_rows(
    file: str, rows: NDArray[np.int64], where: Where, signals: dict[str, Numbers]
) -> tuple[NDArray[np.bool_], list[tuple[int, str]]]:
    """Which rows hold a number in every column, and the number and reason of the others."""
    bad = ~(np.abs(np.concatenate([*signals.values()], 1)) <= _LARGEST)
    names = [
        where[name][k] if x.shape[1] <= len(where[name]) else f"{where[name][0]}[{k}]"
        for name, x in signals.items()
        for k in range(x.shape[1])
    ]
    wrong = np.asarray(bad.any(1))
    if len(wrong) and wrong.mean() > _MOST_CORRUPT:
        worst = [name for name, share in zip(names, bad.mean(0)) if share > _MOST_CORRUPT / len(names)]
        raise RecordingError(
            f"{file}: {wrong.mean():.0%} of its rows are without a number, in column {listed(worst)}"
        )
    lacking = [[name for name, is_bad in zip(names, bad[k]) if is_bad] for k in np.flatnonzero(wrong)]
    return ~wrong, [
        (int(row), f"no number in {listed(some, 3)}") for row, some in zip(rows[: len(wrong)][wrong], lacking)
    ]
