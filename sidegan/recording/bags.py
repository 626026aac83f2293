"""ROS 2 bags and MCAP files with `sensor_msgs/JointState`; the only door to rosbags."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sidegan.base.storage import reading
from sidegan.errors import RecordingError
from sidegan.recording.settings import RecordingSettings
from sidegan.recording.tables import Table, Where

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import Connection

_SUFFIXES = (".db3", ".mcap")
_KIND = "sensor_msgs/msg/JointState"
_FIELDS = ("position", "velocity", "effort")
_NANOSECONDS = 1e-9


def is_bag(path: Path) -> bool:
    """Whether a path is a ROS 2 bag: its folder or one of its files."""
    return path.is_dir() or path.suffix.lower() in _SUFFIXES


def bag_files(path: Path) -> list[Path]:
    """Files in a bag's folder, sorted by name."""
    inside = sorted(path.iterdir())
    if not any(file.suffix in _SUFFIXES or file.name == "metadata.yaml" for file in inside):
        raise RecordingError(f"{path} is a folder without a bag: it has no .db3 or .mcap file")
    return [file for file in inside if file.is_file()]


def bag_table(path: Path, settings: RecordingSettings, names: Sequence[str]) -> tuple[Table, Where]:
    """Joint states of the named joints in a bag, and which of its columns hold which signal.

    Time stamps are the headers', or the bag's where headers have none. Messages without any of the joints,
    such as a gripper's, are skipped. Messages with only some of them become corrupt rows.
    """
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with reading(path, "bag", RecordingError), AnyReader([path], default_typestore=store) as reader:
        connections = _connections(path, reader, settings.topic)
        messages: list[tuple[int, Any]] = [  # time of receipt [ns], and a message
            (at, reader.deserialize(raw, _KIND)) for _, at, raw in reader.messages(connections)
        ]
    if not messages:
        raise RecordingError(f"{path.name} holds no samples: its topic of joint states is empty")
    seen = {name for _, message in messages for name in message.name}
    if missing := [name for name in names if name not in seen]:
        raise RecordingError(
            f"{path.name} has no joint {', '.join(missing)}; it has {', '.join(sorted(seen))}"
        )
    whole = next((message for _, message in messages if {*names} <= {*message.name}), None)
    if whole is None:
        raise RecordingError(
            f"{path.name} has no message with all of the arm's joints: record a topic on which they come "
            "together, as from a joint_state_broadcaster"
        )
    fields = [field for field in _FIELDS if len(getattr(whole, field)) == len(whole.name)]
    if "position" not in fields:
        raise RecordingError(f"{path.name}: its joint states have no positions")
    rows = np.array([_row(m, at, names, fields) for at, m in messages if {*names} & {*m.name}])
    signals = np.split(rows[:, 1:], len(fields), 1)
    where = {settings.effort if field == "effort" else field: [field] for field in fields}
    table = Table({"time": rows[:, 0], **dict(zip(fields, signals))}, np.arange(len(rows)) + 1)
    return table, {"time": ["time"], **where}


def _connections(path: Path, reader: "AnyReader", topic: str | None) -> "list[Connection]":
    """Connections of the configured joint state topic, or of the only one."""
    of_states = [c for c in reader.connections if c.msgtype == _KIND]
    topics = sorted({c.topic for c in of_states})
    if not topics:
        others = ", ".join(sorted({f"{c.topic} ({c.msgtype})" for c in reader.connections})) or "nothing"
        raise RecordingError(f"{path.name} has no joint states ({_KIND}); it has {others}")
    if topic is None and len(topics) > 1:
        raise RecordingError(
            f"{path.name} has joint states on {', '.join(topics)}; choose one by recording.topic"
        )
    if topic is not None and topic not in topics:
        raise RecordingError(f"{path.name} has joint states on {', '.join(topics)}, not on {topic}")
    return [c for c in of_states if topic is None or c.topic == topic]


def _row(message: Any, received: int, names: Sequence[str], fields: Sequence[str]) -> list[float]:
    """Time [s] from the header, or else from the bag, and the joints' values; NaN where missing."""
    stamp = message.header.stamp
    place = {name: i for i, name in enumerate(message.name)}
    row = [stamp.sec + stamp.nanosec * _NANOSECONDS or received * _NANOSECONDS]
    for field in fields:
        values = dict(enumerate(getattr(message, field).tolist()))
        row += [values.get(place.get(name, -1), math.nan) for name in names]
    return row
