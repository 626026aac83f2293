"""How fast the parts are, each beside an opponent measured in the same minute."""

import os

for _library in ("OMP", "OPENBLAS", "MKL"):  # read when NumPy is imported, so here and not later
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
# Threads that wait give their core to whoever needs it: on a busy machine spinning costs a factor of ten.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
