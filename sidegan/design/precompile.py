"""Compile kernels of a search for this processor: ``python -m sidegan.design.precompile``."""

import numpy as np

from sidegan.design.objective import Goal, Objective
from sidegan.design.problem import Problem, SearchSettings
from sidegan.design.search import search
from sidegan.kernels import goals
from sidegan.kernels.objective import slopes
from sidegan.motion.dynamics import gram
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import load_robot
from sidegan.validity import Constraints, check


def compile_kernels() -> None:
    """Compile the kernels of the proof, of Gram matrices, and last those that a search compiles first."""
    unit = np.eye(2)
    goal = goals.GoalArrays(goals.CONDITION, unit, 1.0, unit, unit, 1.0)
    goals.goal_of.compile_for(goal, unit, unit, goals.goal_buffers(goal))
    constraints = Constraints(load_robot("planar2"))
    family = Trajectory(2)
    problem = Problem(constraints, family)
    objective = Objective(problem, Goal())
    slopes.compile_for(objective.plan, 1, objective.scratch)
    still = np.zeros((1, *family.shape))
    check(constraints, family, still)
    gram(constraints.body, family, still)
    search(problem, Goal(), SearchSettings(evaluations=10, patience=10))


if __name__ == "__main__":
    compile_kernels()
