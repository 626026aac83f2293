"""Compile kernels of a search in another process, while this one does something else."""

import os
import subprocess
import sys
from contextlib import suppress
from functools import cache

from sidegan.base.parallel import worker_count
from sidegan.kernels.descent import descend
from sidegan.kernels.proof import visit

_begun: list[subprocess.Popen[bytes]] = []  # kept: dropping a running process causes a warning


@cache
def compile_beside() -> None:
    """Start compiling in another process, unless the kernels are already compiled.

    At most once per process, only with a second core, and never from a frozen program, which would start
    itself. The other process begins with what this one needs last, and waits for what this one compiles.
    numba compiles one kernel at a time in a process, so only another process can use a second core.
    """
    python = "" if getattr(sys, "frozen", False) else sys.executable or ""
    missing = visit.to_be_compiled() or descend.to_be_compiled()
    if "python" in python.rpartition("/")[2] and worker_count(None) > 1 and missing:
        command = [python, "-m", "sidegan.design.precompile"]
        alone = {**os.environ, "LOKY_MAX_CPU_COUNT": "1"}  # that process starts no other
        quiet = subprocess.DEVNULL
        with suppress(OSError):  # the kernels then compile when they are needed
            _begun.append(subprocess.Popen(command, env=alone, stdin=quiet, stdout=quiet, stderr=quiet))
