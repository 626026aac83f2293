"""ROS 2 bags and MCAP files with `sensor_msgs/JointState`; the only door to rosbags."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sidegan.errors import RecordingError
from sidegan.recording.batch import Batch
from sidegan.recording.columns import Columns
from sidegan.recording.tables import Piece, reading

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import Connection

_KIND = "sensor_msgs/msg/JointState"


def is_bag(path: Path) -> bool:
    """Whether a path is a ROS 2 bag: a folder, or a file of one."""
    return path.is_dir() or path.suffix.lower() in (".db3", ".mcap")


def bag_pieces(
    path: Path, columns: Columns, joint_names: Sequence[str], rows: int
) -> tuple[Iterator[Piece], dict[str, list[str]]]:
    """Pieces of a bag's joint states, and which of their columns is which signal.

    Time is that of the header, or that of the bag where headers have none. A message that lacks one of the
    arm's joints is a corrupt row.

    Raises:
        RecordingError: when the bag cannot be read, has no joint states, several topics of them, none of
            the arm's joints, or no positions.
    """
    names = columns.file_joints(path.name, joint_names)
    with _opened(path) as reader, reading(path):
        connections = _connections(path, reader, columns.topic)
        present = _signals(path, reader, connections, names, columns.effort)
    where = {"time": ["time"], **{signal: [signal] for signal in present}}
    return _pieces(path, columns, names, list(present), rows), where


@contextmanager
def _opened(path: Path) -> "Iterator[AnyReader]":
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    with reading(path):
        reader = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
        reader.open()
    try:
        yield reader
    finally:
        reader.close()


def _connections(path: Path, reader: "AnyReader", topic: str | None) -> "list[Connection]":
    """Those of the topic of joint states that is meant."""
    found = [c for c in reader.connections if c.msgtype == _KIND]
    topics = sorted({c.topic for c in found})
    if not topics:
        others = ", ".join(sorted({f"{c.topic} ({c.msgtype})" for c in reader.connections})) or "nothing"
        raise RecordingError(f"{path.name} has no joint states ({_KIND}); it has {others}")
    if topic is None and len(topics) > 1:
        raise RecordingError(
            f"{path.name} has joint states on {', '.join(topics)}; choose one by recording.topic"
        )
    if topic is not None and topic not in topics:
        raise RecordingError(f"{path.name} has no joint states on {topic}, but on {', '.join(topics)}")
    return [c for c in found if topic is None or c.topic == topic]


def _signals(
    path: Path, reader: "AnyReader", connections: "list[Connection]", names: Sequence[str], effort: str
) -> dict[str, str]:
    """Field of the messages for every signal that the first message with the arm's joints has."""
    seen: set[str] = set()
    for connection, _, raw in reader.messages(connections=connections):
        message: Any = reader.deserialize(raw, connection.msgtype)
        seen |= set(message.name)
        if set(names) <= set(message.name):
            fields = {"position": "position", "velocity": "velocity", effort: "effort"}
            found = {s: f for s, f in fields.items() if len(getattr(message, f)) == len(message.name)}
            if "position" not in found:
                raise RecordingError(f"{path.name}: its joint states have no positions")
            return found
        if len(seen) > 1000:
            break
    missing = [name for name in names if name not in seen]
    if not seen:
        raise RecordingError(f"{path.name} holds no samples: its topic of joint states is empty")
    told = f"has no joint {', '.join(missing)}" if missing else "has no message with all of the arm's joints"
    raise RecordingError(f"{path.name} {told}; it has {', '.join(sorted(seen))}")


def _pieces(
    path: Path, columns: Columns, names: Sequence[str], present: list[str], rows: int
) -> Iterator[Piece]:
    """Pieces of ``rows`` messages; those that know none of the joints, such as a gripper's, are left out."""
    batch = Batch(names, {signal: "effort" if signal == columns.effort else signal for signal in present})
    with _opened(path) as reader, reading(path):
        connections = _connections(path, reader, columns.topic)
        for connection, received, raw in reader.messages(connections=connections):
            batch.add(received, bytes(raw), partial(reader.deserialize, typ=connection.msgtype))
            if len(batch) == rows:
                yield batch.piece()
    if len(batch):
        yield batch.piece()
