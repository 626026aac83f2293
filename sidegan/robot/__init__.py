"""What the arm is: placements, axes, inertias, limits and capsules as plain tensors, read from a URDF."""

from sidegan.robot.arm import Arm, Capsules
from sidegan.robot.load import built_in_robots, load_robot
from sidegan.robot.oracle import capsule_geometry, pinocchio_model

__all__ = ["Arm", "Capsules", "built_in_robots", "capsule_geometry", "load_robot", "pinocchio_model"]
