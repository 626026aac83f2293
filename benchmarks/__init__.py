"""How fast the parts are on one thread, each beside an opponent measured in the same minute."""

import os

for _library in ("OMP", "OPENBLAS", "MKL"):  # read when NumPy is imported, so here and not later
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
