"""An online loop: while an arm moves along one trajectory, the next one is designed within half a second."""

import math

from sidegan.design.problem import Problem, SearchSettings
from sidegan.design.search import ConditionGoal, search
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import load_robot
from sidegan.validity import Constraints

arm = load_robot("planar2")
family = Trajectory(arm.joints, harmonics=4, period=8.0)
problem = Problem(Constraints(arm, []), family)
aim = ConditionGoal(problem)  # a small condition number of all trajectories together
settings = SearchSettings(evaluations=50, patience=50, samples=40, reserve=0.05)
search(problem, aim.next(), settings)  # once without a deadline, which loads what is compiled

for k in range(4):
    found = search(problem, aim.next(), settings, seed=k, deadline=0.5)  # [s]; valid by proof
    aim.take(family, found.coefficients)
    condition = math.exp(found.value)  # goals are logarithms
    print(f"trajectory {k + 1}: the condition number of all so far is {condition:.3g}")
