"""An excitation set: valid trajectories that are optimised to excite an arm, and the five to execute."""

import numpy as np

from sidegan.design.excitation import excite
from sidegan.design.greedy import greedy
from sidegan.design.problem import Problem
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import load_robot
from sidegan.seeding import Gradient
from sidegan.validity import Constraints, Plane, check

arm = load_robot("planar2")
constraints = Constraints(arm, [Plane(normal=(0, 0, 1), offset=0.0)])
family = Trajectory(arm.joints, harmonics=4, period=8.0)

search = Gradient(steps=60, attempts=5, reserve=0.05)
c = search.optimise(Problem(constraints, family), 20, np.random.SeedSequence(0)).coefficients  # (20, J, H, 2)
assert check(constraints, family, c).valid.all()

excitation = excite(constraints.body, family, c)
chosen = greedy(excitation.diagonal, count=5)
conditions = excitation.eigenvalue_fitness[chosen]  # of YᵀY of each trajectory
print("picked", chosen.tolist(), "with condition numbers", [f"{x:.3g}" for x in conditions.tolist()])

motion = family.roll_out(c[chosen], family.times(rate=100))  # (5, T, J) each, to be sent to a controller
print("the first ends at", motion.position[0, -1].tolist(), "after", float(motion.time[-1]), "s")
