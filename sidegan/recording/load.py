"""From files to recordings in SI units."""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sidegan.base.arrays import Array
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
from sidegan.recording.tables import Table, Where, json_table, mat_table, npz_table, parquet_table
from sidegan.recording.text import text_table
from sidegan.recording.units import Units

_MOST_CORRUPT = 0.5  # of the rows of a file
_LARGEST = 1e12  # of any signal in SI units: what is larger is no measurement
_LATEST = 1e21  # of a time; one beyond the largest number is a damaged row, unless most are
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
    """
    name = recording_name(files)
    joints = Joints.of(name, settings, joint_names, chain, sliding)
    each: list[tuple[str | None, Path]] = [
        (None, Path(paths_of(files)[0]))
    ]  # the signal of interest, and a file
    if isinstance(files, Files):
        paths = files.signals(settings.effort).items()
        each = [(signal, Path(path)) for signal, path in paths if getattr(settings, signal)]
    signals, corrupt, remarks = merged([_read(path, settings, joints, only) for only, path in each])
    every: dict[str, Any] = {**signals, "corrupt": tuple(corrupt), "remarks": tuple(remarks)}
    made = Recording(name, tuple(joint_names), **every)
    return driven(unwrapped(made, joints.slides))


def recording_name(files: Recorded | Path) -> str:
    """The file's name; of several, the first one's."""
    return listed([Path(path).name for path in paths_of(files)], 1)


def files_of(path: Path) -> list[Path]:
    """The files of a recording: itself, or those of a folder."""
    if not path.is_dir():
        return [path]
    return dataset_files(path) if is_dataset(path) else bag_files(path)


def _read(path: Path, settings: RecordingSettings, joints: Joints, only: str | None) -> Part:
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
        remarks.append(f"{listed(sorted(rates))} is derived, since positions are encoder counts")
    signals: dict[str, Array] = {}
    with reading(path, path.suffix[1:], RecordingError):
        if "time" in where:
            signals["time"], odd = stamps_in_si(table, where["time"], settings.units)
            remarks = [*odd, *remarks]
        for name in [name for name in where if name != "time"]:
            signals[name] = _in_si(path.name, table, name, where[name], settings, joints)
            table.forget({*where[name]} - {c for one in where.keys() - signals.keys() for c in where[one]})
    if len({len(x) for x in signals.values()}) > 1:
        lengths = ", ".join(f"{where[name][0]} has {len(x)}" for name, x in signals.items())
        raise RecordingError(f"{path.name}: the arrays differ in length: {lengths}")
    parts = [_part(path.name, where, some, rows, settings.rate) for some, rows in _apart(signals, table.rows)]
    signals, corrupt, more = merged(parts)
    remarks = [*_headed(where, settings.units, joints), *remarks, *more]
    return Part(path.name, "time" in where, signals, [*table.skipped, *corrupt], remarks)


def _apart(signals: dict[str, Array], rows: Array) -> list[tuple[dict[str, Array], Array]]:
    """Signals and their rows, (S,): all of them, or each, with time, at the rows where it has any numbers.

    The latter where one comes at moments of its own, so that many cells are blank.
    """
    blank = {name: np.asarray(np.isnan(x).all(1)) for name, x in signals.items() if name != "time"}
    if not any(_APART < lacks.mean() < 1 for lacks in blank.values()):
        return [(signals, rows)]
    return [
        ({one: signals[one][~lacks] for one in ("time", name) if one in signals}, rows[: len(lacks)][~lacks])
        for name, lacks in blank.items()
    ]


def _part(file: str, where: Where, signals: dict[str, Array], rows: Array, rate: float | None) -> Part:
    """Signals without rows that lack a number."""
    good, corrupt = _whole_rows(file, rows, where, signals)
    if not good.any():
        raise RecordingError(f"{file} holds no samples")
    kept = signals if good.all() else {name: x[good] for name, x in signals.items()}
    time = kept["time"][:, 0] if "time" in kept else rows[: len(good)][good] / (rate or 1.0)
    label = f"the {listed([name for name in signals if name != 'time'])} of {file}"
    return Part(label, "time" in kept, {**kept, "time": time}, corrupt, [])


def _headed(where: Where, units: Units, joints: Joints) -> list[str]:
    """A sentence on the units that columns are headed with, where these count."""
    found = []
    for name, columns in where.items():
        slides = (False,) if name == "time" else joints.slides
        found += [(name, units.read(name, *each)) for each in zip(slides, columns)]
    each = ", ".join(f"{signal} in {unit}" for signal, unit in dict.fromkeys(found) if unit)
    return [f"{each}, according to the column names; recording.units overrides them"] if each else []


def _open(
    path: Path, settings: RecordingSettings, joints: Joints, only: str | None
) -> tuple[Table, Where, list[str]]:
    """A file's table, which of its columns is which signal, and remarks on that."""
    suffix, dataset = path.suffix.lower(), is_dataset(path)
    if is_bag(path) and not dataset:
        table, where = bag_table(path, settings, joints.names)
        if only and only not in where:
            raise RecordingError(f"{path.name}: its joint states have {', '.join([*where][1:])}, not {only}")
        return table, {name: where[name] for name in ("time", only)} if only else where, []
    if not dataset and suffix not in _READERS:
        raise RecordingError(
            f"{path} has the suffix {suffix or 'none'}, expected {', '.join(_READERS)} or a bag"
        )
    with reading(path, suffix[1:], RecordingError):
        table = dataset_table(path) if dataset else _READERS[suffix](path)
        return table, *Finder(path.name, table, settings, joints, only).found()


def _in_si(
    file: str, table: Table, name: str, where: Sequence[str], settings: RecordingSettings, joints: Joints
) -> Array:
    """A signal (S, J) in SI units, of columns (S,), or of one (S, J)."""
    columns = [table.numbers(column) for column in where]
    if columns[0].ndim > 2 or (where[1:] and any(x.shape != (len(columns[0]),) for x in columns)):
        shapes = ", ".join(f"{one} is {x.shape}" for one, x in zip(where, columns))
        raise RecordingError(f"{file}: columns must have one length and one number per row: {shapes}")
    x = np.stack(columns).T if where[1:] else columns[0].reshape(len(columns[0]), -1)
    if x.shape[1] != len(joints.own):
        arm = f"the arm has {counted(len(joints.own), 'joint')}"
        raise RecordingError(f"{file}: {where[0]!r} is {x.shape}, {arm}")
    if name == "position" and settings.units.position is not None:
        return settings.units.position.in_si(x, joints.slides)
    headings = where if where[1:] else [*where] * len(joints.own)
    factors = [settings.units.factor(name, *each) for each in zip(joints.slides, headings)]
    return np.multiply(x, factors, out=x if where[1:] else None)


def _whole_rows(
    file: str, rows: Array, where: Where, signals: dict[str, Array]
) -> tuple[Array, list[tuple[int, str]]]:
    """Which rows hold a number in every column, and the number and reason of the others."""
    names, lacks = [], []
    for name, some in signals.items():
        for k, x in enumerate(some.T):
            one = some.shape[1] <= len(where[name])  # a column for each joint
            names.append(where[name][k] if one else f"{where[name][0]}[{k}]")
            lacks.append(~(np.abs(x) <= _most(name, x)))
    missing = np.stack(lacks)  # (C, S)
    wrong = np.asarray(missing.any(0))
    if len(wrong) and wrong.mean() > _MOST_CORRUPT:
        worst = [name for name, share in zip(names, missing.mean(1)) if share > _MOST_CORRUPT / len(names)]
        raise RecordingError(
            f"{file}: {wrong.mean():.0%} of its rows lack a number, in column {listed(worst)}"
        )
    corrupt = []
    for k in np.flatnonzero(wrong).tolist():
        lacking = [names[c] for c in np.flatnonzero(missing[:, k])]
        corrupt.append((int(rows[k]), f"no number in {listed(lacking, 3)}"))
    return ~wrong, corrupt


def _most(name: str, column: Array) -> float:
    """The largest number that a column (S,) may hold."""
    late = name == "time" and np.count_nonzero(np.abs(column) > _LARGEST) > len(column) / 2
    return _LATEST if late else _LARGEST
