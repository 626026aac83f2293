"""Trajectories as the controllers of robots take them: CSV, ROS 2, URScript."""

from sidegan.controllers.approach import approach
from sidegan.controllers.course import POINTS, Course, least_rate, slower
from sidegan.controllers.deliver import deliver
from sidegan.controllers.settings import Delivery
from sidegan.controllers.urscript import SCRIPTED

__all__ = ["POINTS", "SCRIPTED", "Course", "Delivery", "approach", "deliver", "least_rate", "slower"]
