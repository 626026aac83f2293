"""Kernels that a search needs after its descents, compiled by another process while this one compiles those.

``python -m sidegan.design.beside`` compiles them.
"""

import subprocess
import sys

from sidegan.base.parallel import cores
from sidegan.kernels.proof import visit


def compile_beside() -> None:
    """Begin to compile the proof and what measures information, unless that was done or is being done."""
    if cores(None) > 1 and visit.to_be_compiled():
        command = [sys.executable, "-m", "sidegan.design.beside"]
        subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _compile() -> None:
    import numpy as np

    from sidegan.motion.dynamics import gram
    from sidegan.motion.operations import extremes
    from sidegan.motion.trajectory import Trajectory
    from sidegan.robot import load_robot
    from sidegan.validity import Constraints, check

    constraints, family = Constraints(load_robot("planar2")), Trajectory(2)
    still = np.zeros((1, *family.shape))
    extremes(gram(constraints.body, family, still), 1, 1)
    check(constraints, family, still)


if __name__ == "__main__":
    _compile()
