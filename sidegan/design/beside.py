"""Kernels that a search needs after its descents, compiled by another process while this one compiles those.

``python -m sidegan.design.beside`` compiles them.
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
    """Begin to compile the proof and what measures information, unless that was done or is being done.

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
