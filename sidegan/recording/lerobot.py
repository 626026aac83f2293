"""Datasets of LeRobot, versions 2 and 3: Parquet files of frames that ``meta/info.json`` describes."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sidegan.base.storage import reading
from sidegan.errors import RecordingError
from sidegan.recording.tables import Numbers, Rows, Table, parquet_table

_INFO, _FRAMES = "meta/info.json", "data/chunk-*/*.parquet"
_TIME, _EPISODE = "timestamp", "episode_index"
_PAUSE = 10.0  # [s] that is put between two episodes, whose clocks begin at zero


def is_dataset(path: Path) -> bool:
    """Whether a path is the folder of a dataset."""
    return (path / _INFO).is_file()


def dataset_files(path: Path) -> list[Path]:
    """Files of a dataset that hold numbers: its description, and its frames in the order of episodes.

    Raises:
        RecordingError: when it has no frames.
    """
    frames = sorted(path.glob(_FRAMES))
    if not frames:
        raise RecordingError(f"{path} is a LeRobot dataset without frames: there is no {_FRAMES}")
    return [path / _INFO, *frames]


def dataset_table(path: Path) -> Table:
    """The frames of a dataset, episode after episode on one clock.

    Columns are those of its files. One that holds a vector whose elements have names is a column for each of
    them instead: ``observation.state.shoulder.pos``.

    Raises:
        RecordingError: when the description is none, or the files have no episodes on a clock.
    """
    info, *files = dataset_files(path)
    with reading(info, "JSON", RecordingError):
        features = json.loads(info.read_text("utf-8")).get("features", {})
        named = {feature: _names(about) for feature, about in features.items()}
    with reading(files[0], "Parquet", RecordingError):
        available = parquet_table(files[0]).columns
    if missing := [name for name in (_TIME, _EPISODE) if name not in available]:
        raise RecordingError(f"{files[0]} has no column {', '.join(missing)}: is it of a LeRobot dataset?")
    # a column's own column in the files, and the element of the vector in that
    places: dict[str, tuple[str, int | None]] = {}
    for column in available:
        if names := named.get(column, []):
            places |= {f"{column}.{name}": (column, k) for k, name in enumerate(names)}
        else:
            places[column] = column, None
    return Table([*places], lambda columns: _rows(files, places, columns))


def _names(about: Any) -> list[str]:
    """Names of a vector's elements, each another one; none where it has none."""
    names = about.get("names")
    if isinstance(names, dict) and len(names) == 1:  # by what they are: motors
        (names,) = names.values()
    if not isinstance(names, list) or len(names) < 2 or [len(names)] != list(about.get("shape", [])):
        return []  # what holds one number is no vector in the file
    return [str(name) for name in names] if len(set(names)) == len(names) else []


def _rows(files: Sequence[Path], places: dict[str, tuple[str, int | None]], columns: Sequence[str]) -> Rows:
    """Frames of all files, numbered from 1, with episodes apart in time."""
    needed = [*dict.fromkeys([_EPISODE, _TIME, *(places[name][0] for name in columns)])]
    parts = []
    for file in files:
        with reading(file, "Parquet", RecordingError):
            parts.append(parquet_table(file).read(needed).columns)
    frames = {name: np.concatenate([part[name] for part in parts]) for name in needed}
    frames[_TIME] = _one_clock(frames[_EPISODE], frames[_TIME])
    elements = {name: frames[places[name][0]] for name in columns}
    values = {name: x if (k := places[name][1]) is None else x[:, k] for name, x in elements.items()}
    return Rows(values, np.arange(len(frames[_TIME])) + 1)


def _one_clock(episode: Numbers, time: Numbers) -> Numbers:
    """Times [s] of frames (S,) from 0 on, of which episode they are and their time in it."""
    starts = np.flatnonzero(np.diff(episode)) + 1
    steps = np.diff(time, prepend=time[:1])
    steps[starts] = _PAUSE
    return np.cumsum(steps)
