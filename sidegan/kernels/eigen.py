"""Compiled algebra of small symmetric matrices: factors, inverses, eigenpairs.

Eigenpairs at both ends of a spectrum cost a fraction of what all of them do. The matrix is made tridiagonal
by Householder reflections; Sturm counts at several shifts at a time close in on the eigenvalues at the ends;
an eigenvector is the solution of the two-sided factorisation that is nearest to being singular.

Sources: Golub, Van Loan 2013, Matrix Computations, 8.3 and 8.4; Dhillon, Parlett 2004, Orthogonal
eigenvectors and relative gaps, for the two-sided (twisted) factorisation.
"""

import math

import numpy as np

from sidegan.base.arrays import Array
from sidegan.kernels.jit import inline, inline_in_any_order, kernel

_POINTS = 8  # shifts per eigenvalue and pass: each narrows its bracket to a ninth
_PASSES = 19  # from twice the matrix's size to 1e-16 of its largest element
_TINY = 1e-290  # keeps a division finite
_NOISE = 1e-16  # a smaller pivot is rounding, for a matrix with elements up to one
_APART = 1e-9  # larger products of eigenvectors: nearly equal eigenvalues, which are not for this method
_RESIDUE = 1e-13


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
def _reflect(a: Array, k: int, e: Array, tau: Array, w: Array) -> None:
    """Clear row and column k beyond the second diagonal; the reflection I − τ v vᵀ stays in row k."""
    v, p = a[k, k + 1 :], w[k + 1 :]
    rest = product(v[1:], v[1:], len(v) - 1)
    e[k], tau[k] = v[0], 0.0
    if rest == 0:
        return
    e[k] = -math.copysign(math.sqrt(v[0] * v[0] + rest), v[0])
    tau[k] = (e[k] - v[0]) / e[k]
    factor = 1 / (v[0] - e[k])
    for i in range(len(v)):
        v[i] *= factor
        p[i] = 0.0
    v[0] = 1.0
    for j in range(len(v)):
        add_to(p, v[j], a[k + 1 + j, k + 1 :], len(v))
    half = tau[k] * product(p, v, len(v)) / 2
    for i in range(len(v)):
        p[i] = tau[k] * (p[i] - half * v[i])
    for j in range(len(v)):
        row, x, y = a[k + 1 + j, k + 1 :], v[j], p[j]
        for i in range(len(row)):
            row[i] -= x * p[i] + y * v[i]


@kernel
def _tridiagonal(matrix: Array, d: Array, e: Array, tau: Array, w: Array) -> None:
    """Write the diagonals of a tridiagonal matrix with the same eigenvalues; reflections stay in the rows."""
    size = len(matrix)
    for k in range(size):
        if k + 1 < size:
            _reflect(matrix, k, e, tau, w)
        d[k] = matrix[k, k]


@kernel
def _count(d: Array, e: Array, shifts: Array, pivots: Array, below: Array) -> None:
    """Number of eigenvalues below each shift."""
    for m in range(len(shifts)):
        pivots[m], below[m] = 1.0, 0.0
    for i in range(len(d)):
        square = e[i - 1] * e[i - 1] if i > 0 else 0.0
        for m in range(len(shifts)):
            q = d[i] - shifts[m] - square / pivots[m]
            q = -_TINY if abs(q) < _TINY else q
            pivots[m] = q
            below[m] += 1.0 if q < 0 else 0.0


@kernel
def _close_in(d: Array, e: Array, low: int, first: int, values: Array, work: Array) -> None:
    """Write ``low`` eigenvalues from rank ``first`` on, and the largest ones, as many as there are values."""
    size, count = len(d), len(values)
    left, right, most = work[3], work[4], count * _POINTS
    shifts, pivots, below = work[0, :most], work[1, :most], work[2, :most]
    smallest, largest = d[0], d[0]
    for i in range(size):
        beside = (abs(e[i - 1]) if i > 0 else 0.0) + (abs(e[i]) if i + 1 < size else 0.0)
        smallest, largest = min(smallest, d[i] - beside), max(largest, d[i] + beside)
    for k in range(count):
        left[k], right[k] = smallest - _NOISE, largest + _NOISE
    for _ in range(_PASSES):
        for k in range(count):
            for m in range(_POINTS):
                shifts[k * _POINTS + m] = left[k] + (right[k] - left[k]) * ((m + 1) / (_POINTS + 1))
        _count(d, e, shifts, pivots, below)
        for k in range(count):
            rank = first + k if k < low else size - count + k
            for m in range(_POINTS):
                shift = shifts[k * _POINTS + m]
                if below[k * _POINTS + m] <= rank:
                    left[k] = max(left[k], shift)
                else:
                    right[k] = min(right[k], shift)
    for k in range(count):
        values[k] = (left[k] + right[k]) / 2


@kernel
def _solid(pivot: float) -> float:
    return pivot if abs(pivot) > _NOISE else math.copysign(_NOISE, pivot)


@kernel
def _vector(d: Array, e: Array, value: float, z: Array, down: Array, up: Array) -> None:
    """Write the tridiagonal matrix's unit eigenvector of an eigenvalue."""
    size, best = len(d), 0
    down[0], up[size - 1] = _solid(d[0] - value), _solid(d[size - 1] - value)
    for i in range(1, size):
        k = size - 1 - i
        down[i] = _solid(d[i] - value - e[i - 1] * e[i - 1] / down[i - 1])
        up[k] = _solid(d[k] - value - e[k] * e[k] / up[k + 1])
    least = np.inf
    for i in range(size):
        gap = abs(down[i] + up[i] - (d[i] - value))
        if gap < least:
            best, least = i, gap
    z[best] = 1.0
    for i in range(best - 1, -1, -1):
        z[i] = -e[i] * z[i + 1] / down[i]
    for i in range(best + 1, size):
        z[i] = -e[i - 1] * z[i - 1] / up[i]
    length = math.sqrt(product(z, z, size))
    for i in range(size):
        z[i] /= length


@kernel
def _sound(d: Array, e: Array, values: Array, z: Array) -> bool:
    """Whether these are eigenpairs of the tridiagonal matrix, and the vectors at right angles."""
    size = len(d)
    for k in range(len(values)):
        for i in range(size):
            rest = (d[i] - values[k]) * z[k, i]
            rest += e[i - 1] * z[k, i - 1] if i > 0 else 0.0
            rest += e[i] * z[k, i + 1] if i + 1 < size else 0.0
            if not abs(rest) < _RESIDUE * size:
                return False
        for m in range(k):
            if not abs(product(z[k], z[m], size)) < _APART:
                return False
    return True


def scratch(size: int, count: int) -> tuple[Array, Array]:
    """Scratch for the kernel at work; not to be shared among threads."""
    return np.zeros((5, size)), np.zeros((5, count * _POINTS))


@kernel
def ends(matrix: Array, first: int, values: Array, rows: Array, shifts: Array) -> None:
    """Write the eigenvalue of rank ``first``, from the smallest, and the largest one, (2,).

    They are those of a symmetric matrix with elements up to one. The matrix (p, p) is
    overwritten; the rest is ``scratch`` for two values or more.
    """
    _tridiagonal(matrix, rows[0], rows[1], rows[2], rows[3])
    _close_in(rows[0], rows[1], 1, first, values, shifts)


@kernel
def extremes(
    a: Array, low: int, values: Array, vectors: Array, sound: Array, rows: Array, shifts: Array
) -> None:
    """Write the ``low`` smallest eigenvalues and as many of the largest as there is place for, ascending.

    The symmetric matrices (B, p, p), with elements up to one, are overwritten. Written are values, (B, K),
    unit eigenvectors row by row, (B, K, p), and whether they are reliable, (B,); the rest is ``scratch``.
    """
    d, e, tau, w, up = rows[0], rows[1], rows[2], rows[3], rows[4]
    size = a.shape[1]
    for b in range(len(a)):
        matrix = a[b]
        _tridiagonal(matrix, d, e, tau, w)
        _close_in(d, e, low, 0, values[b], shifts)
        for k in range(values.shape[1]):
            _vector(d, e, values[b, k], vectors[b, k], w, up)
        sound[b] = _sound(d, e, values[b], vectors[b])
        for m in range(values.shape[1]):
            for k in range(size - 2, -1, -1):
                part, v = vectors[b, m, k + 1 :], matrix[k, k + 1 :]
                if tau[k] != 0:
                    add_to(part, -tau[k] * product(v, part, len(v)), v, len(v))


_SWEEPS = 30
_ROUNDING = 1e-30  # squared share of the diagonal that is left beside it


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
