"""Trajectories as the controllers of robots take them: CSV, ROS 2, URScript."""

from sidegan.controllers.approach import approach
from sidegan.controllers.course import POINTS, Course, knots, least_rate, run_of, slower
from sidegan.controllers.deliver import deliver
from sidegan.controllers.ros2 import goal_text, write_mcap
from sidegan.controllers.settings import Delivery
from sidegan.controllers.table import csv_text
from sidegan.controllers.urscript import SCRIPTED, script_text

__all__ = [
    "POINTS",
    "SCRIPTED",
    "Course",
    "Delivery",
    "approach",
    "csv_text",
    "deliver",
    "goal_text",
    "knots",
    "least_rate",
    "run_of",
    "script_text",
    "slower",
    "write_mcap",
]
