"""Methods of the room, small, and problems of the design room."""

from sidegan.seeding.methods import Gradient, Paper
from tests.design.conftest import lwr_problem, planar_problem, random

__all__ = ["METHODS", "lwr_problem", "planar_problem", "random"]

METHODS = {
    "gradient": Gradient(20, attempts=5, reserve=0.2),
    "paper": Paper(generations=6, ants=20, evaluations=150, box=0.5, attempts=5),
}
