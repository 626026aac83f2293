from tests.design.conftest import lwr_problem, planar_problem, random

__all__ = ["lwr_problem", "planar_problem", "random"]
