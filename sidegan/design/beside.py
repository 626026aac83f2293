"""Kernels of a search that another process compiles, while this one compiles the others.

They are what descents call last, and the proof that follows; ``python -m sidegan.design.beside`` does it.
"""

import subprocess
import sys
from contextlib import suppress
from functools import cache

from sidegan.base.parallel import cores
from sidegan.kernels.proof import visit

_begun: list[subprocess.Popen[bytes]] = []  # held: what is dropped while it runs is warned of


@cache
def compile_beside() -> None:
    """Begin to compile them, unless that was done or is being done.

    Once in a process, where there is a second core, and never by a program that has Python within it, which
    would start itself.
    """
    python = "" if getattr(sys, "frozen", False) else sys.executable or ""
    if "python" in python.rpartition("/")[2] and cores(None) > 1 and visit.to_be_compiled():
        quiet = subprocess.DEVNULL
        with suppress(OSError):  # then it is compiled when it is needed
            command = [python, "-m", "sidegan.design.beside"]
            _begun.append(subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet))


def _compile() -> None:
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

    one = np.eye(2)
    goal = goals.GoalArrays(goals.CONDITION, one, 1.0, one, one, 1.0)
    goals.goal_of.compile_for(goal, one, one, goals.scratch(goal))
    constraints, family = Constraints(load_robot("planar2")), Trajectory(2)
    objective = Objective(Problem(constraints, family), Goal())
    slopes.compile_for(objective.plan, 1, objective.scratch)
    still = np.zeros((1, *family.shape))
    check(constraints, family, still)
    gram(constraints.body, family, still)


if __name__ == "__main__":
    _compile()
