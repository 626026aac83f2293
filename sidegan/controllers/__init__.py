"""Trajectories as files for robot controllers: CSV, ROS 2, URScript."""

from sidegan.controllers.approach import approach
from sidegan.controllers.course import POINTS, Course, least_rate, slower
from sidegan.controllers.export import APPROACH, RETURN, export_set
from sidegan.controllers.ros2 import SHELL
from sidegan.controllers.settings import ExportSettings
from sidegan.controllers.urscript import SCRIPTED

__all__ = [
    "APPROACH",
    "POINTS",
    "RETURN",
    "SCRIPTED",
    "SHELL",
    "Course",
    "ExportSettings",
    "approach",
    "export_set",
    "least_rate",
    "slower",
]
