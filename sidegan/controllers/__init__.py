"""Trajectories as the controllers of robots take them: CSV, ROS 2, URScript."""

from sidegan.controllers.course import Course, knots, run_of
from sidegan.controllers.ros2 import goal_text, write_mcap
from sidegan.controllers.table import csv_text
from sidegan.controllers.urscript import script_text

__all__ = ["Course", "csv_text", "goal_text", "knots", "run_of", "script_text", "write_mcap"]
