"""Recordings written to files of every kind."""

import numpy as np
import pandas as pd
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

LETTERS = {"position": "q", "velocity": "qd", "acceleration": "qdd", "torque": "tau", "current": "i"}


def frame(recording):
    columns = {"t": recording.time}
    for name, x in recording.signals().items():
        columns |= {f"{LETTERS[name]}{j + 1}": x[:, j] for j in range(x.shape[1])}
    return pd.DataFrame(columns)


def written(change=lambda table: table, **options):
    """A writer of a CSV whose table was changed."""

    def write(recording, folder):
        change(frame(recording)).to_csv(folder / "a.csv", **{"index": False, **options})
        return folder / "a.csv"

    return write


write_csv = written()


def write_parquet(recording, folder):
    frame(recording).to_parquet(folder / "a.parquet")
    return folder / "a.parquet"


def arrays(**changes):
    """A writer of an array of all joints a signal."""

    def write(recording, folder):
        signals = {LETTERS[name]: x for name, x in recording.signals().items()}
        np.savez(folder / "a.npz", **{"t": recording.time, **signals, **changes})
        return folder / "a.npz"

    return write


def write_lists(recording, folder, names=None):
    """A Parquet file with a list of all joints a signal; with names of joints, from the last to the first."""
    order = slice(None, None, -1 if names else 1)
    columns = {LETTERS[name]: [*x[:, order]] for name, x in recording.signals().items()}
    if names:
        columns["name"] = [names[order]] * len(recording.time)
    pd.DataFrame({"t": recording.time, **columns}).to_parquet(folder / "a.parquet")
    return folder / "a.parquet"


def write_messages(folder, messages, kind="sensor_msgs/msg/JointState", plugin=StoragePlugin.SQLITE3):
    """A bag of messages: nanoseconds, byte order, and for a joint state its names and arrays."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    make, header = store.types[kind], store.types["std_msgs/msg/Header"]
    stamp = store.types["builtin_interfaces/msg/Time"]
    with Writer(folder / "bag", version=9, storage_plugin=plugin) as writer:
        to = writer.add_connection("/joint_states", kind, typestore=store)
        for nanoseconds, little, *values in messages:
            when = stamp(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
            message = make(header(when, ""), *values) if kind.startswith("sensor") else make(*values)
            writer.write(to, nanoseconds, store.serialize_cdr(message, kind, little_endian=little))
    return folder / "bag"


def write_bag(recording, folder, plugin=StoragePlugin.SQLITE3, names=None, order=None):
    """Joint states with positions, velocities and torques as efforts; ``order`` shuffles the joints."""
    names, order = names or list(recording.joint_names), order or list(range(len(recording.joint_names)))
    signals = [getattr(recording, name).take(order, 1) for name in ("position", "velocity", "torque")]
    stamps = [round(t * 1e9) + 10**9 for t in recording.time.tolist()]
    named = [names[i] for i in order]
    messages = ((t, True, named, *(x[k] for x in signals)) for k, t in enumerate(stamps))
    return write_messages(folder, messages, plugin=plugin)


def write_mcap(recording, folder):
    return write_bag(recording, folder, StoragePlugin.MCAP)
