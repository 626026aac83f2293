"""A course as a program for Universal Robots' controllers."""

import re

import torch

from sidegan.controllers.course import Course

SCRIPTED = 6  # of every arm that runs URScript
_PERIOD = 0.008  # [s] between two points: the slowest of these controllers takes one every 8 ms
_LOOKAHEAD, _GAIN = 0.1, 300  # of servoj [s] and without a unit, as the manual has them
_APPROACH = "a=0.3, v=0.2"  # of the straight way in joint space to the first point [rad/s², rad/s]
_AWAY = 0.05  # [rad] from the first point beyond which the program refuses to start


def script_text(course: Course, name: str) -> str:
    """A URScript program that follows the course by ``servoj``, a point every 8 ms.

    It refuses to start away from the course's first point, to which it does not move on its own.

    Args:
        course: of six joints.
        name: of the program; what is no letter, digit or underscore becomes one.
    """
    title = re.sub("[^a-zA-Z0-9]", "_", name)
    points = course.sampled(1 / _PERIOD).position
    servo = f"0, 0, {_PERIOD}, {_LOOKAHEAD}, {_GAIN}"
    steps = "\n".join(f"  servoj({_list(point)}, {servo})" for point in points)
    return f"""def {title}():
  start = {_list(points[0])}
  at = get_actual_joint_positions()
  k = 0
  while k < {SCRIPTED}:
    if norm(at[k] - start[k]) > {_AWAY}:
      popup("The arm is not at the first point of the trajectory.", error=True, blocking=True)
      halt
    end
    k = k + 1
  end
  movej(start, {_APPROACH})
{steps}
  stopj(2.0)
end
{title}()
"""


def _list(values: torch.Tensor) -> str:
    return "[" + ", ".join(f"{x:.9g}" for x in values.tolist()) + "]"
