"""Recordings written to files of every kind."""

import numpy as np
import pandas as pd
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from sidegan.recording.load import load_recording
from tests.recording.conftest import COULOMB, VISCOUS, moved, of_file

JOINTS = "shoulder", "elbow"
LETTERS = {"position": "q", "velocity": "qd", "acceleration": "qdd", "torque": "tau", "current": "i"}


def frame(recording):
    columns = {"t": recording.time}
    for name, x in recording.signals().items():
        columns |= {f"{LETTERS[name]}{j + 1}": x[:, j] for j in range(x.shape[1])}
    return pd.DataFrame(columns)


def table(recording, **columns):
    """Time, positions and torques of a recording; columns may be changed, added, or, as None, left out."""
    changed = {**frame(recording)[["t", "q1", "q2", "tau1", "tau2"]], **columns}
    return pd.DataFrame({name: x for name, x in changed.items() if x is not None})


def columns_of(pattern):
    return [pattern.format(i=k, n=k + 1, j=joint) for k, joint in enumerate(JOINTS)]


def named(recording, time="t", q="q{n}", tau="tau{n}", **more):
    """The table under other names, and with more columns."""
    return table(recording).set_axis([time, *columns_of(q), *columns_of(tau)], axis=1).assign(**more)


def load(files, names=JOINTS, chain=None, **changes):
    """A recording of joints with these names, as it is read from files with changed settings."""
    return load_recording(files, of_file(**changes), names, chain)


def read(folder, table, names=JOINTS, sliding=(), **changes):
    """A table as it is read from a file."""
    table.to_csv(folder / "a.csv", index=False)
    return load(folder / "a.csv", names, {name: name in sliding for name in names}, **changes)


def assert_same(found, made, signals=("position", "torque"), start=0, late=2e-6):
    np.testing.assert_allclose(found.time, made.time + start, atol=late, rtol=0)
    for name in signals:
        np.testing.assert_allclose(found.signals()[name], made.signals()[name], atol=1e-9, rtol=0)


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


def write_moved(path, arm, seed, seconds=30):
    """A CSV of a random motion of a planar arm at 100 Hz, with friction and noise."""
    time = np.arange(seconds * 100) / 100
    frame(moved(arm, time, VISCOUS, COULOMB, np.random.default_rng(seed))).to_csv(path, index=False)
    return path


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
