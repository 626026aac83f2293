"""A course for ROS 2: the goal of a joint trajectory controller as text, and a bag of messages."""

import math
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from sidegan.base.storage import replacing
from sidegan.controllers.course import STATES, Course

_KEYS = ("positions", "velocities", "accelerations")
_SECOND = 10**9  # [ns]
_TOPIC = "/{}/joint_trajectory"


def goal_text(course: Course) -> str:
    """A goal of ``control_msgs/action/FollowJointTrajectory`` as YAML, for ``ros2 action send_goal``.

    Every point has position, velocity and acceleration, so that the controller draws quintics between them.
    """
    names = yaml.safe_dump([*course.joint_names], default_flow_style=True, width=math.inf, allow_unicode=True)
    lines = ["trajectory:", f"  joint_names: {names.strip()}", "  points:"]
    states = (getattr(course, name).tolist() for name in STATES)
    for time, *values in zip(course.time.tolist(), *states):  # twenty times as fast as PyYAML
        duration = ", ".join(f"{unit}: {amount}" for unit, amount in _duration(time).items())
        rows = [f"{key}: [{', '.join(f'{x:.9f}' for x in row)}]" for key, row in zip(_KEYS, values)]
        lines.append("  - " + "\n    ".join([*rows, f"time_from_start: {{{duration}}}"]))
    return "\n".join([*lines, ""])


def write_mcap(courses: Mapping[str, Course], path: Path) -> None:
    """Write courses as ``trajectory_msgs/JointTrajectory`` into one MCAP, under ``/<name>/joint_trajectory``.

    Raises:
        StorageError: when the file cannot be written.
    """
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with replacing(path) as draft, tempfile.TemporaryDirectory(dir=draft.parent) as folder:
        bag = Path(folder) / path.stem
        with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            for name, course in courses.items():
                message = _message(store.types, course)
                kind = message.__msgtype__
                to = writer.add_connection(_TOPIC.format(name), kind, typestore=store)
                writer.write(to, 0, store.serialize_cdr(message, kind))
        (made,) = bag.glob("*.mcap")
        shutil.move(made, draft)


def _message(types: Mapping[str, Any], course: Course) -> Any:
    stamp, duration = types["builtin_interfaces/msg/Time"], types["builtin_interfaces/msg/Duration"]
    header = types["std_msgs/msg/Header"](stamp(0, 0), "")
    point = types["trajectory_msgs/msg/JointTrajectoryPoint"]
    values = zip(*(getattr(course, name).numpy() for name in STATES))
    points = [
        point(*states, states[0][:0], duration(**_duration(time)))
        for time, states in zip(course.time.tolist(), values)
    ]
    return types["trajectory_msgs/msg/JointTrajectory"](header, list(course.joint_names), points)


def _duration(time: float) -> dict[str, int]:
    """Time [s] as a duration's whole seconds and nanoseconds."""
    seconds, nanoseconds = divmod(round(time * _SECOND), _SECOND)
    return {"sec": seconds, "nanosec": nanoseconds}
