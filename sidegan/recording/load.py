"""From files to recordings in SI units."""

from collections.abc import Collection, Mapping, Sequence
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
from sidegan.recording.mended import driven, unwrapped
from sidegan.recording.merged import Part, merged
from sidegan.recording.recording import Recording
from sidegan.recording.settings import Files, Recorded, RecordingSettings, paths_of
from sidegan.recording.stamps import stamps_in_si
from sidegan.recording.tables import Numbers, Table, Where, json_table, mat_table, npz_table, parquet_table
from sidegan.recording.text import text_table
from sidegan.recording.units import Units, told

_MOST_CORRUPT = 0.5  # of the rows of a file
_LARGEST = 1e12  # of any signal in SI units, and of a time: what is larger is no measurement
_APART = 0.1  # of the rows: where a signal lacks in as many, it comes at other moments than the others
_READERS = {
    **dict.fromkeys((".csv", ".tsv", ".txt"), text_table),
    **dict.fromkeys((".parquet", ".pq"), parquet_table),
    **dict.fromkeys((".jsonl", ".ndjson"), json_table),
    ".npz": npz_table,
    ".mat": mat_table,
}


def load_recording(
    files: Recorded | Path,
    settings: RecordingSettings,
    joint_names: Sequence[str],
    chain: Sequence[str] = (),
    sliding: Collection[str] = (),
) -> Recording:
    """A recording of an arm's joints, from a file or from one for each signal.

    It is CSV (first line: column names), Parquet, JSON lines, NPZ, a MATLAB file, a ROS 2 bag (folder, .db3,
    .mcap) or a LeRobot dataset (folder). The chain are the names of the arm's joints and of those locked
    between them, from the base outwards; no names: no others. Some joints slide; the others turn, and where
    their readings jump by a turn, that is taken out. So are rows at rest without drives.

    Raises:
        RecordingError: when a file cannot be read or does not fit the arm.
    """
    name = recording_name(files)
    joints = Joints.of(name, settings, joint_names, chain, sliding)
    if not isinstance(files, Files):
        part = _read(Path(files), settings, joints)
        signals, corrupt, remarks = part.signals, part.corrupt, part.remarks
    else:
        wanted = [(k, path) for k, path in files.signals(settings.effort).items() if getattr(settings, k)]
        signals, corrupt, remarks = merged([_read(Path(path), settings, joints, k) for k, path in wanted])
    tensors: dict[str, Any] = {key: torch.from_numpy(np.ascontiguousarray(x)) for key, x in signals.items()}
    made = Recording(name, tuple(joint_names), corrupt=tuple(corrupt), remarks=tuple(remarks), **tensors)
    return driven(unwrapped(made, joints.slides))


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
    """The signals of a file, or the only one of interest, without rows that lack a number.

    Where signals come at moments of their own, each has its rows.
    """
    with reading(path, "recording", RecordingError):
        if not path.exists():
            raise RecordingError(f"there is no recording {path}")
        files_of(path)
    table, where, remarks = _open(path, settings, joints, only)
    if settings.units.position is not None and (rates := where.keys() & {"velocity", "acceleration"}):
        where = {name: columns for name, columns in where.items() if name not in rates}
        remarks.append(f"{listed(sorted(rates))} is derived, since positions are counts of encoders")
    with reading(path, path.suffix[1:], RecordingError):
        stamps, odd = stamps_in_si(table, where["time"], settings.units) if "time" in where else (None, [])
        signals = {k: _in_si(path.name, table, k, where[k], settings, joints) for k in where if k != "time"}
    remarks = [*table.remarks, *odd, *_headed(where, settings.units, joints), *remarks]
    signals = signals if stamps is None else {"time": stamps, **signals}
    _refuse_lengths(path.name, signals, where)
    parts = []
    for names, rows in _apart(signals):
        some = {name: signals[name][rows] for name in signals if name in (*names, "time")}
        good, corrupt = _whole_rows(path.name, table.rows[rows], where, some)
        if not good.any():
            raise RecordingError(f"{path.name} holds no samples")
        kept = {name: x[good] for name, x in some.items()}
        numbers = table.rows[rows][good] / (settings.rate or 1.0)
        kept["time"] = numbers if stamps is None else kept["time"][:, 0]
        parts.append(Part(f"the {listed(names)} of {path.name}", stamps is not None, kept, corrupt, []))
    signals, corrupt, more = merged(parts) if parts[1:] else (parts[0].signals, parts[0].corrupt, [])
    return Part(path.name, stamps is not None, signals, [*table.skipped, *corrupt], [*remarks, *more])


def _apart(signals: Mapping[str, Numbers]) -> list[tuple[list[str], NDArray[np.bool_]]]:
    """Names of signals (S, J) and their rows, (S,): of all together, or each where it has any numbers.

    The latter where one comes at moments of its own, so that many cells are blank.
    """
    blank = {name: np.isnan(x).all(1) for name, x in signals.items() if name != "time"}
    if any(_APART < lacks.mean() < 1 for lacks in blank.values()):
        return [([name], ~lacks) for name, lacks in blank.items()]
    return [([*blank], np.ones(len(next(iter(blank.values()))), dtype=bool))]


def _headed(where: Where, units: Units, joints: Joints) -> list[str]:
    """A sentence on the units that columns are headed with, where these count."""
    found = [("time", units.read("time", False, where["time"][0]))] if len(where.get("time", "")) == 1 else []
    for name in [name for name in where if name != "time"]:
        found += [(name, units.read(name, *each)) for each in zip(joints.slides, where[name])]
    return told(found)


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


def _in_si(
    file: str, table: Table, name: str, where: Sequence[str], settings: RecordingSettings, joints: Joints
) -> Numbers:
    """A signal (S, J) in SI units."""
    parts = [table.numbers(column) for column in where]
    if len({len(x) for x in parts}) > 1 or any(x.ndim > 2 for x in parts):
        shapes = ", ".join(f"{column} is {x.shape}" for column, x in zip(where, parts))
        raise RecordingError(f"{file}: columns are not of one length with a number in each row: {shapes}")
    x = np.column_stack(parts)
    if x.shape[1] != len(joints.own):
        arm = f"the arm has {counted(len(joints.own), 'joint')}"
        raise RecordingError(f"{file}: {where[0]!r} is {x.shape}, {arm}")
    if name == "position" and settings.units.position is not None:
        return settings.units.position.in_si(x, joints.slides)
    headings = where if len(where) > 1 else [*where] * len(joints.own)
    return x * [settings.units.factor(name, *each) for each in zip(joints.slides, headings)]


def _refuse_lengths(file: str, signals: dict[str, Numbers], where: Where) -> None:
    """Refuse arrays that are not of one length."""
    if len({len(x) for x in signals.values()}) > 1:
        lengths = ", ".join(f"{where[name][0]} has {len(x)}" for name, x in signals.items())
        raise RecordingError(f"{file}: the arrays are not of the same length: {lengths}")


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
