"""A course for ROS 2: a joint trajectory controller's goal as text."""

import math
from collections.abc import Sequence

import yaml

from sidegan.controllers.course import STATES, Course

SHELL = 128 * 1024  # limit of a command-line argument on Linux [bytes]; larger goals need standard input
_KEYS = ("positions", "velocities", "accelerations")
_SECOND = 10**9  # [ns]
_SETTLING = 2  # time to reach the goal's tolerance after its last point [s]


def goal_text(course: Course, tolerance: Sequence[float], notes: str = "") -> str:
    """A goal of ``control_msgs/action/FollowJointTrajectory`` as YAML, for ``ros2 action send_goal``.

    Every point has position, velocity and acceleration, so that the controller interpolates with quintics.
    The first point is at time zero: the controller checks its tolerance before it moves, and refuses if the
    arm stands elsewhere. Without tolerances a controller does not check, and the arm jumps.

    Args:
        course: from rest to rest.
        tolerance: of each joint's position [rad or m], (J,), on the path and at its end.
        notes: a comment for the first line.
    """
    lines = [f"# {notes}"] if notes else []
    names = yaml.safe_dump([*course.joint_names], default_flow_style=True, width=math.inf, allow_unicode=True)
    lines += ["trajectory:", f"  joint_names: {names.strip()}", "  points:"]
    states = (getattr(course, name).tolist() for name in STATES)
    for time, *values in zip(course.time.tolist(), *states):  # twenty times as fast as PyYAML
        seconds, nanoseconds = divmod(round(time * _SECOND), _SECOND)
        rows = [f"{key}: [{', '.join(f'{x:.9f}' for x in row)}]" for key, row in zip(_KEYS, values)]
        since = f"time_from_start: {{sec: {seconds}, nanosec: {nanoseconds}}}"
        lines.append("  - " + "\n    ".join([*rows, since]))
    each = [{"name": name, "position": most} for name, most in zip(course.joint_names, tolerance)]
    for guard in ({"path_tolerance": each}, {"goal_tolerance": each}):
        lines.append(yaml.safe_dump(guard, width=math.inf, allow_unicode=True, sort_keys=False).rstrip())
    lines.append(f"goal_time_tolerance: {{sec: {_SETTLING}}}\n")
    return "\n".join(lines)
