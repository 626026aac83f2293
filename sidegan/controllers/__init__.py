"""Trajectories as the controllers of robots take them: CSV, ROS 2, URScript."""

from sidegan.controllers.approach import approach
from sidegan.controllers.course import POINTS, Course, least_rate, slower
from sidegan.controllers.deliver import APPROACH, RETURN, deliver
from sidegan.controllers.ros2 import SHELL
from sidegan.controllers.settings import Delivery
from sidegan.controllers.urscript import SCRIPTED

__all__ = [
    "APPROACH",
    "POINTS",
    "RETURN",
    "SCRIPTED",
    "SHELL",
    "Course",
    "Delivery",
    "approach",
    "deliver",
    "least_rate",
    "slower",
]
