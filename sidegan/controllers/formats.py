"""A course as text for controllers: a CSV table, a goal for ROS 2, a URScript program."""

import csv
import io
import math
import re
from collections.abc import Sequence

import numpy as np
import yaml

from sidegan.base.arrays import Array
from sidegan.controllers.course import Course

SHELL = 128 * 1024  # limit of a command-line argument on Linux [bytes]; larger goals need standard input
SCRIPTED = 6  # joints of every arm that runs URScript, all revolute
# A controller with cubic interpolation at 1 kHz divides differences by 1e-9 s³ for the jerk: with nine digits
# its error would be 120 rad/s³.
_DIGITS = "%.12g"
_KEYS = ("positions", "velocities", "accelerations")
_SECOND = 10**9  # [ns]
_SETTLING = 2  # time to reach the goal's tolerance after its last point [s]
_PERIOD = 0.008  # time between points [s]: that of the slowest of these controllers
_SETTLE = 62  # points at the last position, half a second, before the program stops
_LOOKAHEAD, _GAIN = 0.1, 300  # servoj's lookahead time [s] and gain, the manual's defaults
_APPROACH = "a=0.3, v=0.2"  # of the joint-space move to the first point [rad/s², rad/s]


def csv_text(course: Course) -> str:
    """``time`` [s], then ``q_<joint>``, ``dq_<joint>`` and ``ddq_<joint>`` of every joint in SI units.

    These are columns that ``identify`` recognises.
    """
    columns = ["time", *(f"{letter}_{name}" for letter in ("q", "dq", "ddq") for name in course.joint_names)]
    rows = np.concatenate([course.time[:, None], *course[2:]], 1)
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(columns)
    np.savetxt(text, rows, _DIGITS, ",")
    return text.getvalue()


def goal_text(course: Course, tolerance: Sequence[float], notes: str = "") -> str:
    """A goal of ``control_msgs/action/FollowJointTrajectory`` as YAML, for ``ros2 action send_goal``.

    Every point has position, velocity and acceleration, so that the controller interpolates with quintics.
    The first point is at time zero: the controller checks its tolerance before it moves, and refuses if the
    arm stands elsewhere. Without tolerances a controller does not check, and the arm jumps.

    The tolerance is that of each joint's position [rad or m], (J,), on the path and at its end. Notes are a
    comment in the first line.
    """
    lines = [f"# {notes}"] if notes else []
    names = yaml.safe_dump([*course.joint_names], default_flow_style=True, width=math.inf, allow_unicode=True)
    lines += ["trajectory:", f"  joint_names: {names.strip()}", "  points:"]
    states = (x.tolist() for x in course[2:])
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


def script_text(course: Course, name: str, tolerance: float, notes: str = "") -> str:
    """A URScript program that follows the course by ``servoj``, a point every 8 ms.

    The program interpolates with quintics between the course's points, a line each, since programs of many
    thousand lines do not load. It refuses to start away from the course's first point.

    Other characters of its name than letters and digits become underscores. The tolerance is the largest
    distance from the first point at the start [rad]. Notes are a comment in the first line.
    """
    title = re.sub("[^a-zA-Z0-9]", "_", name)
    states = np.stack(course[2:], 1)  # (T, 3, J)
    steps = zip(np.diff(course.time).tolist(), states[1:])
    legs = "\n".join(f"  leg({span:.12f}, {', '.join(map(_list, state))})" for span, state in steps)
    q, dq, ddq = map(_list, states[0])
    servo = f"0, 0, {_PERIOD}, {_LOOKAHEAD}, {_GAIN}"
    comment = f"  # {notes}\n" if notes else ""
    return f"""def {title}():
{comment}  global q = {q}
  global dq = {dq}
  global ddq = {ddq}
  global t = 0.0
  def leg(span, to_q, to_dq, to_ddq):
    point = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    while t < span:
      s = t / span
      r = 1.0 - s
      k = 0
      while k < {SCRIPTED}:
        u = span * dq[k]
        v = 0.5 * span * span * ddq[k]
        near = q[k] + s * (3.0 * q[k] + u + s * (6.0 * q[k] + 3.0 * u + v))
        u = 0.0 - span * to_dq[k]
        v = 0.5 * span * span * to_ddq[k]
        far = to_q[k] + r * (3.0 * to_q[k] + u + r * (6.0 * to_q[k] + 3.0 * u + v))
        point[k] = r * r * r * near + s * s * s * far
        k = k + 1
      end
      servoj(point, {servo})
      global t = t + {_PERIOD}
    end
    global t = t - span
    global q = to_q
    global dq = to_dq
    global ddq = to_ddq
  end
  at = get_actual_joint_positions()
  i = 0
  while i < {SCRIPTED}:
    if norm(at[i] - q[i]) > {tolerance:.9g}:
      popup("The arm is not at the first point of the trajectory.", error=True, blocking=True)
      halt
    end
    i = i + 1
  end
  movej(q, {_APPROACH})
{legs}
  i = 0
  while i < {_SETTLE}:
    servoj(q, {servo})
    i = i + 1
  end
  stopj(2.0)
end
{title}()
"""


def _list(values: Array) -> str:
    return "[" + ", ".join(f"{x:.10f}" for x in values.tolist()) + "]"  # URScript needs floats here
