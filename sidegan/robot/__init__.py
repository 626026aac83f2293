"""Arms: placements, axes, inertias, limits and capsules as tensors, read from a description."""

from sidegan.robot.arm import HIGHER, Arm, Capsules, with_effort
from sidegan.robot.consistency import (
    about_the_centre,
    doubtful_links,
    inconsistent_links,
    placeholder_links,
    possible_links,
    pseudo_inertia,
    require_consistent,
    tell_doubtful,
    tell_placeholder_links,
)
from sidegan.robot.drives import Drives
from sidegan.robot.load import built_in_robots, is_built_in, load_robot
from sidegan.robot.setup import Limits, Setup, words
from sidegan.robot.write import write_urdf
from sidegan.robot.write_mjcf import write_mjcf

__all__ = [
    "HIGHER",
    "Arm",
    "Capsules",
    "Drives",
    "Limits",
    "Setup",
    "about_the_centre",
    "built_in_robots",
    "doubtful_links",
    "inconsistent_links",
    "is_built_in",
    "load_robot",
    "placeholder_links",
    "possible_links",
    "pseudo_inertia",
    "require_consistent",
    "tell_doubtful",
    "tell_placeholder_links",
    "with_effort",
    "words",
    "write_mjcf",
    "write_urdf",
]
