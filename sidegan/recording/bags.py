"""ROS 2 bags and MCAP files with `sensor_msgs/JointState`; the only door to rosbags."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sidegan.base.names import listed
from sidegan.base.storage import reading
from sidegan.errors import RecordingError
from sidegan.recording.merge import ClockedSignals, merge
from sidegan.recording.settings import RecordingSettings
from sidegan.recording.tables import SignalColumns, Table

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import Connection

_SUFFIXES = (".db3", ".mcap")
_KIND = "sensor_msgs/msg/JointState"
_FIELDS = ("position", "velocity", "effort")
_NANOSECONDS = 1e-9

_Stamped = tuple[int, Any]  # time of receipt [ns], and a message
_Groups = dict[tuple[str, ...], list[_Stamped]]  # messages by joints


def is_bag(path: Path) -> bool:
    """Whether a path is a ROS 2 bag: its folder or one of its files."""
    return path.is_dir() or path.suffix.lower() in _SUFFIXES


def bag_files(path: Path) -> list[Path]:
    """Files in a bag's folder, sorted by name."""
    inside = sorted(path.iterdir())
    if not any(file.suffix in _SUFFIXES or file.name == "metadata.yaml" for file in inside):
        raise RecordingError(f"{path} is a folder without a bag: it has no .db3 or .mcap file")
    return [file for file in inside if file.is_file()]


def bag_table(
    path: Path, settings: RecordingSettings, names: Sequence[str]
) -> tuple[Table, SignalColumns, list[str]]:
    """Joint states of the named joints in a bag, which of its columns hold which signal, and remarks.

    Time stamps are the headers', or the bag's where headers have none. Messages without any of the joints,
    such as a gripper's, are skipped. Messages with only some of them become corrupt rows; if none has all,
    those of different joints are merged by their time stamps.
    """
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with reading(path, "bag", RecordingError), AnyReader([path], default_typestore=store) as reader:
        connections = _connections(path, reader, settings.topic)
        messages: list[_Stamped] = [
            (at, reader.deserialize(raw, _KIND)) for _, at, raw in reader.messages(connections)
        ]
    groups = _groups(path, messages, names)
    firsts = [next(m for _, m in x if {*own} <= {*m.name}) for own, x in groups.items()]
    fields = [x for x in _FIELDS if all(len(getattr(m, x)) == len(m.name) for m in firsts)]
    if "position" not in fields:
        raise RecordingError(f"{path.name}: its joint states have no positions")
    whole = merge([_signals_of(path, own, x, fields, len(groups) > 1) for own, x in groups.items()])
    found = {"time": whole.time}
    for field in fields:
        found[field] = np.concatenate([whole.signals[f"{field} {name}"] for name in names], 1)
    remarks = whole.remarks
    if len(groups) > 1:
        apart = "; ".join(map(listed, groups))
        remarks = [f"joints come in separate messages ({apart}): merged by their time stamps", *remarks]
    where = {settings.effort if field == "effort" else field: [field] for field in fields}
    return Table(found, np.arange(len(whole.time)) + 1), {"time": ["time"], **where}, remarks


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


def _groups(path: Path, messages: Sequence[_Stamped], names: Sequence[str]) -> _Groups:
    """Messages by the joints taken from them: all joints if any message has them, else those that it has."""
    if not messages:
        raise RecordingError(f"{path.name} holds no samples: its topic of joint states is empty")
    seen = {name for _, message in messages for name in message.name}
    if missing := [name for name in names if name not in seen]:
        raise RecordingError(
            f"{path.name} has no joint {', '.join(missing)}; it has {', '.join(sorted(seen))}"
        )
    whole = any({*names} <= {*message.name} for _, message in messages)
    groups: _Groups = {}
    for at, message in messages:
        if own := tuple(name for name in names if name in message.name):
            groups.setdefault(tuple(names) if whole else own, []).append((at, message))
    taken: _Groups = {}
    for own in sorted(groups, key=lambda own: -len(groups[own])):
        if not {*own} <= {name for other in taken for name in other}:
            taken[own] = groups[own]
    return taken


def _signals_of(
    path: Path, own: tuple[str, ...], messages: Sequence[_Stamped], fields: Sequence[str], complete: bool
) -> ClockedSignals:
    """Signals of these joints, a column each; ``complete``: only of messages with a number for each."""
    rows = np.array([_row(message, at, own, fields) for at, message in messages])
    rows = rows[np.isfinite(rows).all(1)] if complete else rows
    if not len(rows):
        raise RecordingError(f"{path.name}: no message of {listed(own)} has a number for each joint")
    columns = [f"{field} {name}" for field in fields for name in own]
    signals = dict(zip(columns, rows.T[1:, :, None]))
    return ClockedSignals(f"the messages of {listed(own)} in {path.name}", True, rows[:, 0], signals, [], [])


def _row(message: Any, received: int, names: Sequence[str], fields: Sequence[str]) -> list[float]:
    """Time [s] from the header, or else from the bag, and the joints' values; NaN where missing."""
    stamp = message.header.stamp
    row = [stamp.sec + stamp.nanosec * _NANOSECONDS or received * _NANOSECONDS]
    for field in fields:
        values = dict(zip(message.name, getattr(message, field).tolist()))
        row += [values.get(name, math.nan) for name in names]
    return row
