import os

for _library in ("OMP", "OPENBLAS", "MKL"):  # read when NumPy is imported; inherited by parallel workers
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
