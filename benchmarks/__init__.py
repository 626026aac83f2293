r"""How fast the parts are, in one table: CPU time on one thread, beside Pinocchio.

    pytest benchmarks --benchmark-only                  # some minutes
    pytest benchmarks --benchmark-only -k regressor     # a part of it

Two trees are compared on one machine, one after the other; times are then shown side by side, and what became
slower by a fifth fails the command:

    cd old && pytest benchmarks --benchmark-only --benchmark-storage=/tmp/speed --benchmark-save=old
    cd new && pytest benchmarks --benchmark-only --benchmark-storage=/tmp/speed --benchmark-compare \
        --benchmark-compare-fail=median:20%
"""

import os

for _library in ("OMP", "OPENBLAS", "MKL"):  # read when NumPy is imported, so here and not later
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
