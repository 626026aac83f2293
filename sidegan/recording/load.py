"""Recordings in SI units, read from files."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import counted, listed
from sidegan.base.storage import reading
from sidegan.errors import RecordingError
from sidegan.recording import tables, thresholds
from sidegan.recording.bags import bag_files, bag_table, is_bag
from sidegan.recording.columns import Finder, Joints
from sidegan.recording.lerobot import dataset_files, dataset_table, is_dataset
from sidegan.recording.merge import ClockedSignals, merge
from sidegan.recording.recording import Recording
from sidegan.recording.repairs import remove_undriven, unwrap
from sidegan.recording.settings import SIGNALS, Files, Recorded, RecordingSettings, paths_of
from sidegan.recording.stamps import stamps_in_si
from sidegan.recording.tables import SignalColumns, Table
from sidegan.recording.text import text_table
from sidegan.recording.units import Units

_PARQUET = b"PAR1"  # first bytes of such files
_READERS = {
    **dict.fromkeys((".csv", ".tsv", ".txt"), text_table),
    **dict.fromkeys((".parquet", ".pq"), tables.parquet_table),
    **dict.fromkeys((".jsonl", ".ndjson", ".json"), tables.json_table),
    **dict.fromkeys((".h5", ".hdf5"), tables.hdf5_table),
    ".npz": tables.npz_table,
    ".mat": tables.mat_table,
}


def load_recording(
    files: Recorded | Path,
    settings: RecordingSettings,
    joint_names: Sequence[str],
    chain: Mapping[str, bool] | None = None,
) -> Recording:
    """A recording of an arm's joints, from one file or from a file per signal.

    Files are CSV (first line: column names), Parquet, JSON, NPZ, HDF5, MATLAB, ROS 2 bags (folder, .db3,
    .mcap) or LeRobot datasets (folder). ``chain`` says of the arm's joints and of those locked between them,
    from the base outwards, whether each is prismatic; None: no joint is locked or prismatic. Positions of
    revolute joints are unwrapped where they jump by a turn. Rows at rest with the drives off are removed.
    """
    name = recording_name(files)
    joints = Joints.of(name, settings, joint_names, chain or {})
    sources: list[tuple[str | None, Path]] = [(None, Path(paths_of(files)[0]))]  # signal of interest, file
    if isinstance(files, Files):
        paths = files.signals(settings.effort).items()
        sources = [(signal, Path(path)) for signal, path in paths if getattr(settings, signal)]
    headed: dict[str, str] = {}
    found = merge([_read(path, settings, joints, only, headed) for only, path in sources])
    corrupt, remarks = tuple(found.corrupt), tuple(found.remarks)
    units = settings.units.with_stated(headed)
    raw = Recording(
        name, joints.own, found.time, corrupt=corrupt, remarks=remarks, units=units, **found.signals
    )
    read = unwrap(raw, joints.slides)
    if settings.coupling:
        matrix = settings.motion_matrix(joint_names)
        coupled = {name: x @ matrix.T for name, x in read.signals().items() if name in SIGNALS[:3]}
        read = replace(read, **coupled)  # type: ignore[arg-type]
    return remove_undriven(read)


def recording_name(files: Recorded | Path) -> str:
    """Name of the recording's file, or of the first of several."""
    return listed([Path(path).name for path in paths_of(files)], 1)


def files_of(path: Path) -> list[Path]:
    """Files of a recording: the path itself, or those in its folder."""
    if not path.is_dir():
        return [path]
    return dataset_files(path) if is_dataset(path) else bag_files(path)


def _read(
    path: Path, settings: RecordingSettings, joints: Joints, only: str | None, headed: dict[str, str]
) -> ClockedSignals:
    """All signals of a file, or only one, without corrupt rows; signals with their own clocks are merged.

    To ``headed`` are added the units of time, angle and length in its headings.
    """
    with reading(path, "recording", RecordingError):
        if not path.exists():
            raise RecordingError(f"there is no recording {path}")
        files_of(path)
        suffix = _suffix(path)
    signals: dict[str, Array] = {}
    stated: list[str] = []
    with reading(path, suffix[1:], RecordingError):
        table, where, remarks = _open(path, suffix, settings, joints, only)
        rates = sorted(where.keys() & {"velocity", "acceleration"})
        if settings.units.position is not None and rates:
            where = {name: columns for name, columns in where.items() if name not in rates}
            remarks.append(f"{listed(rates)} is derived, since positions are encoder counts")
        for name, columns in where.items():
            if name == "time":
                signals[name], units, odd = stamps_in_si(path.name, table, columns, settings.units)
                remarks = [*odd, *remarks]
            else:
                signals[name], units = _in_si(path.name, table, name, columns, settings.units, joints)
            if name in ("time", "position"):
                kinds = ["length" if slides else "angle" for slides in joints.slides]
                headed |= {k: unit for k, unit in zip(["time"] if name == "time" else kinds, units) if unit}
            stated += [f"{name} in {unit}" for unit in dict.fromkeys(units) if unit]
            table.forget({*columns} - {c for other in where.keys() - signals.keys() for c in where[other]})
    if len({len(x) for x in signals.values()}) > 1:
        lengths = ", ".join(f"{where[name][0]} has {len(x)}" for name, x in signals.items())
        raise RecordingError(f"{path.name}: the arrays differ in length: {lengths}")
    if stated:
        source = "row of units" if table.units else "column names"
        read = f"{', '.join(stated)}, according to the {source}; recording.units overrides them"
        remarks = [read, *remarks]
    apart = _apart(signals, table.rows)
    found = merge([_without_corrupt_rows(path.name, where, *group, settings.rate) for group in apart])
    return found._replace(
        file=path.name, corrupt=[*table.skipped, *found.corrupt], remarks=[*remarks, *found.remarks]
    )


def _suffix(path: Path) -> str:
    """Suffix of a file in lower case; also that of a Parquet file without one, as of a stored data frame."""
    if path.suffix or path.is_dir():
        return path.suffix.lower()
    with path.open("rb") as file:
        return ".parquet" if file.read(len(_PARQUET)) == _PARQUET else ""


def _open(
    path: Path, suffix: str, settings: RecordingSettings, joints: Joints, only: str | None
) -> tuple[Table, SignalColumns, list[str]]:
    """A file's table, which of its columns hold which signal, and remarks on that."""
    if is_dataset(path):
        table = dataset_table(path)
    elif is_bag(path):
        table, where, remarks = bag_table(path, settings, joints.names)
        if only and only not in where:
            raise RecordingError(f"{path.name}: its joint states have {', '.join([*where][1:])}, not {only}")
        wanted = {"time", only} if only else {"time", "position", *filter(settings.patterns, where)}
        return table, {name: columns for name, columns in where.items() if name in wanted}, remarks
    elif suffix in _READERS:
        table = _READERS[suffix](path)
    else:
        raise RecordingError(
            f"{path} has the suffix {suffix or 'none'}, expected {', '.join(_READERS)} or a bag"
        )
    table = replace(table, file=path.name)
    return table, *Finder(table, settings, joints, only).found()


def _in_si(
    file: str, table: Table, name: str, where: Sequence[str], units: Units, joints: Joints
) -> tuple[Array, list[str]]:
    """A signal (S, J) in SI units, from columns (S,) or an array (S, J), and the units in their names."""
    columns = [table.numbers(column) for column in where]
    if columns[0].ndim > 2 or (where[1:] and any(x.shape != (len(columns[0]),) for x in columns)):
        shapes = ", ".join(f"{column} is {x.shape}" for column, x in zip(where, columns))
        raise RecordingError(f"{file}: columns must have one length and one number per row: {shapes}")
    x = np.stack(columns).T if where[1:] else columns[0].reshape(len(columns[0]), -1)
    if x.shape[1] != len(joints.own):
        arm = f"the arm has {counted(len(joints.own), 'joint')}"
        raise RecordingError(f"{file}: {where[0]!r} is {x.shape}, {arm}")
    if not where[1:] and {*joints.names} <= {*(order := table.joint_names)}:
        x = x[:, [order.index(joint) for joint in joints.names]]
    if name == "position" and units.position is not None:
        return units.position.in_si(x, joints.slides), []
    names = re.compile(rf"[\[(]({'|'.join(map(re.escape, joints.names))})[\])]")  # may look like units
    headings = [names.sub("", table.heading(column)) for column in where]
    headings *= 1 if where[1:] else len(joints.own)
    stated = [units.of(file, name, *joint) for joint in zip(joints.slides, headings)]
    x = np.multiply(x, [factor for _, factor in stated], out=x if where[1:] else None)
    return x, [unit for unit, _ in stated]


def _apart(signals: dict[str, Array], rows: Array) -> list[tuple[dict[str, Array], Array]]:
    """Signals and their rows, (S,): all together, or each with its time stamps if many cells are blank."""
    blank = {name: np.asarray(np.isnan(x).all(1)) for name, x in signals.items() if name != "time"}
    if not any(thresholds.BLANK_CELLS < lacks.mean() < 1 for lacks in blank.values()):
        return [(signals, rows)]
    return [
        ({key: signals[key][~lacks] for key in ("time", name) if key in signals}, rows[: len(lacks)][~lacks])
        for name, lacks in blank.items()
    ]


def _without_corrupt_rows(
    file: str, where: SignalColumns, signals: dict[str, Array], rows: Array, rate: float | None
) -> ClockedSignals:
    """Signals without corrupt rows, in which a column lacks a plausible number."""
    names, lacks = [], []
    for name in signals.keys() & {"torque", "current"}:
        blank = np.isnan(signals[name]).all(0)
        if blank.any() and not blank.all():  # a driver has none for some joints: refused by their names
            signals[name] = np.where(blank, 0.0, signals[name])
    for name, signal in signals.items():
        largest = thresholds.LARGEST_VALUE
        if name == "time" and 2 * np.count_nonzero(np.abs(signal) > largest) > len(signal):
            largest = thresholds.LATEST_STAMP
        for k, x in enumerate(signal.T):
            separate = signal.shape[1] <= len(where[name])  # a column for each joint
            names.append(where[name][k] if separate else f"{where[name][0]}[{k}]")
            lacks.append(~(np.abs(x) <= largest))
    missing = np.stack(lacks)  # (C, S)
    good = np.asarray(~missing.any(0))
    if len(good) and 1 - good.mean() > thresholds.MOST_CORRUPT:
        share = thresholds.MOST_CORRUPT / len(names)
        worst = [name for name, lacking in zip(names, missing.mean(1)) if lacking > share]
        raise RecordingError(
            f"{file}: {1 - good.mean():.0%} of its rows lack a number, in column {listed(worst)}"
        )
    if not good.any():
        raise RecordingError(f"{file} holds no samples of {listed([x for x in signals if x != 'time'])}")
    corrupt = []
    for k in np.flatnonzero(~good).tolist():
        lacking = [names[c] for c in np.flatnonzero(missing[:, k])]
        corrupt.append((int(rows[k]), f"no number in {listed(lacking, 3)}"))
    whole = slice(None) if good.all() else good  # a view needs no copy
    kept = {name: x[whole] for name, x in signals.items()}
    stamps = kept.pop("time", None)
    time = rows[: len(good)][good] / (rate or 1.0) if stamps is None else stamps[:, 0]
    return ClockedSignals(f"the {listed([*kept])} of {file}", stamps is not None, time, kept, corrupt, [])
