"""Signed margins of all constraints over whole trajectories, guaranteed between samples too."""

from sidegan.validity.check import Validity, check, summarise_faults
from sidegan.validity.constraints import Constraints
from sidegan.validity.home import default_home, usual_effort
from sidegan.validity.regions import Box, Convex, Obstacle, Plane, Sphere

__all__ = [
    "Box",
    "Constraints",
    "Convex",
    "Obstacle",
    "Plane",
    "Sphere",
    "Validity",
    "check",
    "default_home",
    "summarise_faults",
    "usual_effort",
]
