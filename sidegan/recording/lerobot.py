"""LeRobot datasets: folders with a description and Parquet files of frames."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from sidegan.base.storage import reading
from sidegan.errors import RecordingError
from sidegan.recording.tables import Table, parquet_table

_INFO, _FRAMES = "meta/info.json", "data/chunk-*/*.parquet"  # of versions 2 and 3
_TIME, _EPISODE = "timestamp", "episode_index"
_PAUSE = 10.0  # [s] inserted between episodes, whose clocks start at zero


def is_dataset(path: Path) -> bool:
    """Whether a path is a LeRobot dataset's folder."""
    return (path / _INFO).is_file()


def dataset_files(path: Path) -> list[Path]:
    """A LeRobot dataset's description, and its files of frames in the order of episodes."""
    frames = sorted(path.glob(_FRAMES))
    if not frames:
        raise RecordingError(f"{path} is a LeRobot dataset without frames, expected {_FRAMES}")
    return [path / _INFO, *frames]


def dataset_table(path: Path) -> Table:
    """The frames of a LeRobot dataset, with all episodes on one clock.

    A vector with named elements becomes a column per element: ``observation.state.shoulder.pos``.
    """
    info, *files = dataset_files(path)
    with reading(info, "JSON", RecordingError):
        features = json.loads(info.read_text("utf-8")).get("features", {})
        named = {feature: _element_names(about) for feature, about in features.items()}
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


def _element_names(about: Any) -> list[str]:
    """Unique names of a vector's elements; empty if it has none."""
    names = about.get("names")
    if isinstance(names, dict) and len(names) == 1:  # under their kind, such as motors
        (names,) = names.values()
    if not isinstance(names, list) or len(names) < 2 or [len(names)] != list(about.get("shape", [])):
        return []  # a feature of one number is not a vector in the file
    return [str(name) for name in names] if len(set(names)) == len(names) else []
