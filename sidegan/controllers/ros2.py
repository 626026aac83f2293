"""A course for ROS 2: the goal of a joint trajectory controller as text."""

import math

import yaml

from sidegan.controllers.course import STATES, Course

_KEYS = ("positions", "velocities", "accelerations")
_SECOND = 10**9  # [ns]


def goal_text(course: Course) -> str:
    """A goal of ``control_msgs/action/FollowJointTrajectory`` as YAML, for ``ros2 action send_goal``.

    Every point has position, velocity and acceleration, so that the controller draws quintics between them.
    """
    names = yaml.safe_dump([*course.joint_names], default_flow_style=True, width=math.inf, allow_unicode=True)
    lines = ["trajectory:", f"  joint_names: {names.strip()}", "  points:"]
    states = (getattr(course, name).tolist() for name in STATES)
    for time, *values in zip(course.time.tolist(), *states):  # twenty times as fast as PyYAML
        seconds, nanoseconds = divmod(round(time * _SECOND), _SECOND)
        rows = [f"{key}: [{', '.join(f'{x:.9f}' for x in row)}]" for key, row in zip(_KEYS, values)]
        since = f"time_from_start: {{sec: {seconds}, nanosec: {nanoseconds}}}"
        lines.append("  - " + "\n    ".join([*rows, since]))
    return "\n".join([*lines, ""])
