"""Signals of joints on a time grid, compiled: sums of basis functions, and how far they go."""

import math

from sidegan.kernels.chain import Array
from sidegan.kernels.jit import kernel


@kernel
def combine(c: Array, basis: Array, first: int, count: int, out: Array, to: int) -> None:
    """Add sums of basis functions (K, T) with coefficients (J, K), at so many samples from the first on.

    They are added to ``out``, (J, …), from sample ``to`` on. A basis function is read once for all joints.
    """
    for k in range(len(basis)):
        function = basis[k][first : first + count]
        for j in range(len(c)):
            factor, line = c[j, k], out[j][to : to + count]
            for n in range(len(line)):
                line[n] += factor * function[n]


@kernel
def largest(x: Array, count: int) -> float:
    """Largest absolute value of the first samples of a signal."""
    most = 0.0
    for n in range(count):
        most = max(most, abs(x[n]))
    return most


@kernel
def within(x: Array, limit: float) -> float:
    """Smallest margin of |x| to a limit as a share of it; 1 where nothing limits."""
    return 1.0 - largest(x, len(x)) / limit if math.isfinite(limit) else 1.0
