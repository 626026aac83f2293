"""Compiled algebra of small symmetric matrices: factors, inverses, eigenpairs.

The extreme eigenpairs cost a fraction of the full decomposition. Householder reflections make the matrix
tridiagonal; Sturm counts at several shifts at a time bracket the extreme eigenvalues; eigenvectors come from
the twisted factorisation with the smallest pivot.

Sources: Golub, Van Loan 2013, Matrix Computations, 8.3 and 8.4; Dhillon, Parlett 2004, Orthogonal
eigenvectors and relative gaps, for the two-sided (twisted) factorisation.
"""

import math

import numpy as np

from sidegan.base.arrays import Array
from sidegan.kernels.jit import inline, inline_in_any_order, kernel

_POINTS = 8  # shifts per eigenvalue and pass: each pass narrows a bracket to a ninth
_PASSES = 19  # narrow a bracket from twice the matrix's size to 1e-16 of its largest element
_TINY = 1e-290  # avoids division by zero
_NOISE = 1e-16  # smaller pivots are rounding noise, for a matrix with elements up to one
_APART = 1e-9  # a larger product of two eigenvectors: their eigenvalues are too close for this method
_RESIDUE = 1e-13


@inline_in_any_order
def product(x: Array, y: Array, count: int) -> float:
    """Scalar product of the first ``count`` elements of two vectors."""
    total = 0.0
    for i in range(count):
        total += x[i] * y[i]
    return total


@inline
def add_to(x: Array, s: float, y: Array, count: int) -> None:
    """Add s y to x, in the first ``count`` elements."""
    for i in range(count):
        x[i] += s * y[i]


@kernel
def _reflect(a: Array, k: int, e: Array, tau: Array, w: Array) -> None:
    """Zero row and column k beyond the subdiagonal by a reflection I − τ v vᵀ; v stays in row k."""
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
    """Write the diagonals of a similar tridiagonal matrix; the reflections stay in the rows."""
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
    """Fill ``values`` with ``low`` eigenvalues from rank ``first`` on, and then the largest ones."""
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
    """Write the tridiagonal matrix's unit eigenvector for an eigenvalue."""
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
    """Whether these are eigenpairs of the tridiagonal matrix with orthogonal vectors."""
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


def eigen_buffers(size: int, count: int) -> tuple[Array, Array]:
    """Scratch arrays of one thread: rows and shifts."""
    return np.zeros((5, size)), np.zeros((5, count * _POINTS))


@kernel
def extreme_eigenvalues(matrix: Array, first: int, values: Array, rows: Array, shifts: Array) -> None:
    """Write the eigenvalue of ascending rank ``first`` and the largest one, (2,).

    The symmetric matrix (p, p), with elements up to one, is overwritten. Rows and shifts are
    ``eigen_buffers`` for at least two values.
    """
    _tridiagonal(matrix, rows[0], rows[1], rows[2], rows[3])
    _close_in(rows[0], rows[1], 1, first, values, shifts)


@kernel
def extreme_eigenpairs(
    matrix: Array, low: int, values: Array, vectors: Array, rows: Array, shifts: Array
) -> bool:
    """Write the ``low`` smallest and the K − ``low`` largest eigenvalues, ascending, and their eigenvectors.

    The symmetric matrix (p, p), with elements up to one, is overwritten. Outputs: values, (K,), and unit
    eigenvectors as rows, (K, p). Returns whether they are reliable. The rest is ``eigen_buffers``.
    """
    d, e, tau, w, up = rows[0], rows[1], rows[2], rows[3], rows[4]
    _tridiagonal(matrix, d, e, tau, w)
    _close_in(d, e, low, 0, values, shifts)
    for k in range(len(values)):
        _vector(d, e, values[k], vectors[k], w, up)
    sound = _sound(d, e, values, vectors)
    for m in range(len(values)):
        for k in range(len(matrix) - 2, -1, -1):
            part, v = vectors[m, k + 1 :], matrix[k, k + 1 :]
            if tau[k] != 0:
                add_to(part, -tau[k] * product(v, part, len(v)), v, len(v))
    return sound


_SWEEPS = 30
_ROUNDING = 1e-30  # off-diagonal over diagonal sum of squares at convergence


@kernel
def factorise(a: Array) -> bool:
    """Overwrite a matrix's lower triangle with its Cholesky factor; whether it is positive definite."""
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
    """Write the inverse of a lower triangular matrix."""
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
    """Write unit eigenvectors as rows; the eigenvalues remain on the diagonal, unordered.

    Cyclic Jacobi rotations: slow but robust. Source: Golub, Van Loan 2013, Matrix Computations, 8.5.
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
    """Zero element (i, k) by a Jacobi rotation."""
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
