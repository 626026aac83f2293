"""Compile some kernels of a search in another process, while this one compiles the others.

They are those that a descent calls last, and the proof's; ``python -m sidegan.design.beside`` compiles them.
"""

import subprocess
import sys
from contextlib import suppress
from functools import cache

from sidegan.base.parallel import cores
from sidegan.kernels.proof import visit

_begun: list[subprocess.Popen[bytes]] = []  # kept: dropping a running process causes a warning


@cache
def compile_beside() -> None:
    """Start compiling in another process, unless the kernels are already compiled.

    At most once per process, only with a second core, and never from a frozen program, which would start
    itself.
    """
    python = "" if getattr(sys, "frozen", False) else sys.executable or ""
    if "python" in python.rpartition("/")[2] and cores(None) > 1 and visit.to_be_compiled():
        quiet = subprocess.DEVNULL
        with suppress(OSError):  # the kernels then compile when they are needed
            command = [python, "-m", "sidegan.design.beside"]
            _begun.append(subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet))


def compile_kernels() -> None:
    """Compile the kernels of the objective, the validity check and Gram matrices for this processor."""
    import numpy as np

    from sidegan.design.goal import Goal
    from sidegan.design.objective import Objective
    from sidegan.design.problem import Problem
    from sidegan.kernels import goals
    from sidegan.kernels.objective import slopes
    from sidegan.motion.dynamics import gram
    from sidegan.motion.trajectory import Trajectory
    from sidegan.robot import load_robot
    from sidegan.validity import Constraints, check

    unit = np.eye(2)
    goal = goals.GoalArrays(goals.CONDITION, unit, 1.0, unit, unit, 1.0)
    goals.goal_of.compile_for(goal, unit, unit, goals.scratch(goal))
    constraints = Constraints(load_robot("planar2"))
    family = Trajectory(2)
    objective = Objective(Problem(constraints, family), Goal())
    slopes.compile_for(objective.plan, 1, objective.scratch)
    still = np.zeros((1, *family.shape))
    check(constraints, family, still)
    gram(constraints.body, family, still)


if __name__ == "__main__":
    compile_kernels()
