"""Arms read from a description: placements, axes, inertias, limits and collision geometry as arrays."""

from sidegan.base.settings_text import changes, command_messages, robot_settings, setting
from sidegan.robot.arm import DERIVATIVE_ORDER, Arm, Capsules, MotionLimits, with_effort
from sidegan.robot.consistency import (
    about_the_centre,
    describe_doubtful_links,
    describe_placeholder_links,
    doubtful_links,
    inconsistent_links,
    placeholder_links,
    possible_links,
    pseudo_inertia,
    require_consistent,
)
from sidegan.robot.drives import Drives
from sidegan.robot.load import built_in_robots, is_built_in, load_robot
from sidegan.robot.setup import Limits, Setup
from sidegan.robot.write import torque_of_urdf, write_urdf
from sidegan.robot.write_mjcf import torque_of_mjcf, write_mjcf

__all__ = [
    "DERIVATIVE_ORDER",
    "Arm",
    "Capsules",
    "Drives",
    "Limits",
    "MotionLimits",
    "Setup",
    "about_the_centre",
    "built_in_robots",
    "changes",
    "command_messages",
    "describe_doubtful_links",
    "describe_placeholder_links",
    "doubtful_links",
    "inconsistent_links",
    "is_built_in",
    "load_robot",
    "placeholder_links",
    "possible_links",
    "pseudo_inertia",
    "require_consistent",
    "robot_settings",
    "setting",
    "torque_of_mjcf",
    "torque_of_urdf",
    "with_effort",
    "write_mjcf",
    "write_urdf",
]
