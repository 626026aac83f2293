"""Compiled algebra of small symmetric matrices: factors, inverses, all eigenpairs."""

import math

from sidegan.kernels.chain import Array
from sidegan.kernels.jit import inline, inline_in_any_order, kernel

_SWEEPS = 30
_ROUNDING = 1e-30  # squared share of the diagonal that is left beside it


@inline_in_any_order
def product(x: Array, y: Array, count: int) -> float:
    """Scalar product of the first numbers of two vectors."""
    total = 0.0
    for i in range(count):
        total += x[i] * y[i]
    return total


@inline
def add_to(x: Array, s: float, y: Array, count: int) -> None:
    """Add s y to x, of the first numbers."""
    for i in range(count):
        x[i] += s * y[i]


@kernel
def factorise(a: Array) -> bool:
    """Put the Cholesky factor in place of the lower triangle of a matrix; whether it is positive definite."""
    for i in range(len(a)):
        for j in range(i):
            a[i, j] = (a[i, j] - product(a[i], a[j], j)) / a[j, j]
        rest = a[i, i] - product(a[i], a[i], i)
        if not rest > 0:
            return False
        a[i, i] = math.sqrt(rest)
    return True


@kernel
def invert_factor(a: Array, x: Array) -> None:
    """Write the inverse of a lower triangular matrix, lower triangular too."""
    for i in range(len(a)):
        row = x[i]
        for k in range(len(row)):
            row[k] = 0.0
        for k in range(i):
            add_to(row, -a[i, k], x[k], k + 1)
        scale = 1 / a[i, i]
        for k in range(i):
            row[k] *= scale
        row[i] = scale


@kernel
def all_eigenpairs(a: Array, v: Array) -> None:
    """Write unit eigenvectors row by row; the eigenvalues are left on the diagonal, in no order.

    Cyclic Jacobi rotations: slow and sure. Source: Golub, Van Loan 2013, Matrix Computations, 8.5.
    """
    size = len(a)
    for i in range(size):
        for k in range(size):
            v[i, k] = 1.0 if i == k else 0.0
    for _ in range(_SWEEPS):
        beside, total = 0.0, 0.0
        for i in range(size):
            total += a[i, i] * a[i, i]
            for k in range(i):
                beside += a[i, k] * a[i, k]
        if not beside > _ROUNDING * total:
            return
        for i in range(size):
            for k in range(i + 1, size):
                if a[i, k] != 0:
                    _rotate(a, v, i, k)


@kernel
def _rotate(a: Array, v: Array, i: int, k: int) -> None:
    """Clear one element by a rotation."""
    tau = (a[k, k] - a[i, i]) / (2 * a[i, k])
    t = math.copysign(1.0, tau) / (abs(tau) + math.sqrt(1 + tau * tau))
    c = 1 / math.sqrt(1 + t * t)
    s = t * c
    for n in range(len(a)):
        x, y = a[n, i], a[n, k]
        a[n, i], a[n, k] = c * x - s * y, s * x + c * y
    for n in range(len(a)):
        x, y = a[i, n], a[k, n]
        a[i, n], a[k, n] = c * x - s * y, s * x + c * y
        x, y = v[i, n], v[k, n]
        v[i, n], v[k, n] = c * x - s * y, s * x + c * y
