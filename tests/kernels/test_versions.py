"""Kernels compiled for one arm serve every arm."""

from sidegan.design.goal import Goal
from sidegan.design.problem import Problem, SearchSettings
from sidegan.design.search import search
from sidegan.kernels.descent import descend
from sidegan.kernels.proof import visit
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check
from tests.validity.critical import BALL, BOX, HULL, drawn


def test_the_proof_and_the_search_are_compiled_once_for_all_arms(planar, arm):
    for robot in (planar, arm):
        family = Trajectory(robot.joints)
        for regions in ([], [BOX, BALL, HULL]):
            for size in (0.01, 0.03, 0.1):  # some of which are looked at in finer cells
                check(Constraints(robot, regions), family, size * drawn(family, 8))
        problem = Problem(Constraints(robot), family)
        search(problem, Goal(), SearchSettings(evaluations=10, patience=10))
    assert len(visit._compiled.signatures) == len(descend._compiled.signatures) == 1
