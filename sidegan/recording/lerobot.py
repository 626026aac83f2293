"""Datasets of LeRobot, versions 2 and 3: Parquet files of frames that ``meta/info.json`` describes."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from sidegan.base.storage import reading
from sidegan.errors import RecordingError
from sidegan.recording.tables import Table, parquet_table

_INFO, _FRAMES = "meta/info.json", "data/chunk-*/*.parquet"
_TIME, _EPISODE = "timestamp", "episode_index"
_PAUSE = 10.0  # [s] that is put between two episodes, whose clocks begin anew


def is_dataset(path: Path) -> bool:
    """Whether a path is the folder of a dataset."""
    return (path / _INFO).is_file()


def dataset_files(path: Path) -> list[Path]:
    """Files of a dataset that hold numbers: its description, and its frames in the order of episodes."""
    frames = sorted(path.glob(_FRAMES))
    if not frames:
        raise RecordingError(f"{path} is a LeRobot dataset without frames, expected {_FRAMES}")
    return [path / _INFO, *frames]


def dataset_table(path: Path) -> Table:
    """The frames of a dataset, episode after episode on one clock.

    Columns are those of its files. One that holds a vector whose elements have names is a column for each of
    them instead: ``observation.state.shoulder.pos``.
    """
    info, *files = dataset_files(path)
    with reading(info, "JSON", RecordingError):
        features = json.loads(info.read_text("utf-8")).get("features", {})
        named = {feature: _names(about) for feature, about in features.items()}
    parts = []
    for file in files:
        with reading(file, "Parquet", RecordingError):
            parts.append(pd.DataFrame({**parquet_table(file).columns}))
    frames = pd.concat(parts, ignore_index=True)
    if missing := [name for name in (_TIME, _EPISODE) if name not in frames]:
        raise RecordingError(
            f"{files[0]} has no column {', '.join(missing)}: is it part of a LeRobot dataset?"
        )
    steps = frames[_TIME].astype(np.float64).diff().fillna(0.0)
    frames[_TIME] = steps.mask(frames[_EPISODE].diff().fillna(0) != 0, _PAUSE).cumsum()
    columns: dict[str, Any] = {}
    for column, values in frames.items():
        if names := named.get(str(column)):
            columns |= {f"{column}.{name}": x for name, x in zip(names, np.stack([*values]).T)}
        else:
            columns[str(column)] = values
    return Table(columns, np.arange(len(frames)) + 1)


def _names(about: Any) -> list[str]:
    """Names of a vector's elements, each another one; none where it has none."""
    names = about.get("names")
    if isinstance(names, dict) and len(names) == 1:  # by what they are: motors
        (names,) = names.values()
    if not isinstance(names, list) or len(names) < 2 or [len(names)] != list(about.get("shape", [])):
        return []  # what holds one number is no vector in the file
    return [str(name) for name in names] if len(set(names)) == len(names) else []
