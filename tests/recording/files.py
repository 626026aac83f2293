"""Recordings written to files of every kind."""

import numpy as np
import pandas as pd
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

LETTERS = {"position": "q", "velocity": "qd", "acceleration": "qdd", "torque": "tau", "current": "i"}


def frame(recording):
    columns = {"t": recording.time.numpy()}
    for name, x in recording.signals().items():
        columns |= {f"{LETTERS[name]}{j + 1}": x[:, j].numpy() for j in range(x.shape[1])}
    return pd.DataFrame(columns)


def write_csv(recording, folder):
    frame(recording).to_csv(folder / "a.csv", index=False)
    return folder / "a.csv"


def write_parquet(recording, folder):
    frame(recording).to_parquet(folder / "a.parquet")
    return folder / "a.parquet"


def write_npz(recording, folder):
    np.savez(folder / "a.npz", **{name: column.to_numpy() for name, column in frame(recording).items()})
    return folder / "a.npz"


def write_bag(recording, folder, plugin=StoragePlugin.SQLITE3, names=None, topic="/joint_states", order=None):
    """Joint states with positions, velocities and torques as efforts; ``order`` shuffles the joints."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    state, header = store.types["sensor_msgs/msg/JointState"], store.types["std_msgs/msg/Header"]
    stamp = store.types["builtin_interfaces/msg/Time"]
    names = names or list(recording.joint_names)
    order = order or list(range(len(names)))
    signals = recording.signals()
    with Writer(folder / "bag", version=9, storage_plugin=plugin) as writer:
        to = writer.add_connection(topic, state.__msgtype__, typestore=store)
        for k, t in enumerate(recording.time.tolist()):
            nanoseconds = round(t * 1e9) + 10**9
            values = [
                signals[name][k].numpy()[order] if name in signals else np.zeros(0)
                for name in ("position", "velocity", "torque")
            ]
            when = stamp(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
            message = state(header(when, ""), [names[i] for i in order], *values)
            writer.write(to, nanoseconds, store.serialize_cdr(message, state.__msgtype__))
    return folder / "bag"


def write_mcap(recording, folder):
    return write_bag(recording, folder, StoragePlugin.MCAP)
