"""Datasets of LeRobot, versions 2 and 3: Parquet files of frames that ``meta/info.json`` describes."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sidegan.base.storage import reading
from sidegan.errors import RecordingError
from sidegan.recording.tables import Numbers, Piece, Table, parquet_table

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


def dataset_table(path: Path, rows: int) -> Table:
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
        available = parquet_table(files[0], rows).columns
    if missing := [name for name in (_TIME, _EPISODE) if name not in available]:
        raise RecordingError(f"{files[0]} has no column {', '.join(missing)}: is it of a LeRobot dataset?")
    # where a column is: its file's, and the element of the vector in that
    places: dict[str, tuple[str, int | None]] = {}
    for column in available:
        if names := named.get(column, []):
            places |= {f"{column}.{name}": (column, k) for k, name in enumerate(names)}
        else:
            places[column] = column, None
    return Table([*places], lambda columns: _pieces(files, places, columns, rows))


def _names(about: Any) -> list[str]:
    """Names of a vector's elements, each another one; none where it has none."""
    names = about.get("names")
    if isinstance(names, dict) and len(names) == 1:  # by what they are: motors
        (names,) = names.values()
    if not isinstance(names, list) or len(names) < 2 or [len(names)] != list(about.get("shape", [])):
        return []  # what holds one number is no vector in the file
    return [str(name) for name in names] if len(set(names)) == len(names) else []


def _pieces(
    files: Sequence[Path], places: dict[str, tuple[str, int | None]], columns: Sequence[str], rows: int
) -> Iterator[Piece]:
    """Rows of all files, numbered from 1, with episodes apart in time."""
    needed = [*dict.fromkeys([_EPISODE, _TIME, *(places[name][0] for name in columns)])]
    clock, row = _Clock(), 1
    for file in files:
        with reading(file, "Parquet", RecordingError):
            for piece in parquet_table(file, rows).pieces(needed):
                found = piece.columns | {_TIME: clock.times(piece.columns[_EPISODE], piece.columns[_TIME])}
                values = {name: _element(found, *places[name]) for name in columns}
                yield Piece(values, np.arange(row, row + len(piece.rows)))
                row += len(piece.rows)


def _element(columns: dict[str, Numbers], name: str, k: int | None) -> Numbers:
    return columns[name] if k is None else columns[name][:, k]


class _Clock:
    """One clock for episodes whose own ones begin anew."""

    def __init__(self) -> None:
        self._episode, self._offset, self._last = -1.0, 0.0, -_PAUSE

    def times(self, episode: Numbers, time: Numbers) -> Numbers:
        """Times [s] of consecutive frames (S,), of which episode they are and their time in it."""
        out = np.empty(len(time))
        starts = np.flatnonzero(np.diff(episode, prepend=self._episode))
        for first, end in zip([0, *starts], [*starts, len(time)]):
            if first < end:
                if episode[first] != self._episode:
                    self._episode = float(episode[first])
                    self._offset = self._last + _PAUSE - float(time[first])
                out[first:end] = self._offset + time[first:end]
                self._last = float(out[end - 1])
        return out
