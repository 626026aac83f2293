"""Compiled goals, functions of a trajectory's information, and the directions that give their gradients.

A function F of the Gram matrix G = YᵀWY / T has the derivative dF/dG = Σ weight · v vᵀ, so its gradient is
that of the energy Σ weight · |√W Y v|² / T. Each goal writes its vectors v (directions) and their weights.
Y is the regressor of T samples over the p base columns, and W has the weight of each joint's equations. Goals
use an orthonormal basis: ``subspace`` is C, (p, p), lower triangular and sparse, whose columns are that basis
over the base columns.
"""

import math
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array
from sidegan.kernels import HIGHEST, HOPELESS, LOWEST, SHARPNESS, eigen
from sidegan.kernels.dynamics import clear
from sidegan.kernels.eigen import add_to, all_eigenpairs, factorise, invert_factor, product
from sidegan.kernels.jit import kernel, part

KINDS = ("condition", "variance", "volume", "tool")  # of goals
CONDITION, VARIANCE, VOLUME, TOOL = range(len(KINDS))
_TINY = 1e-300


class GoalArrays(NamedTuple):
    """Function to minimise.

    With M = prior + amount · G in an orthonormal basis: the log condition number of M, or the log trace or
    log determinant of A M⁻¹ Aᵀ for targets A. For a tool with torques Y Aᵀ t: the log determinant of the
    covariance of t with the other parameters unknown, after ``runs`` runs, the last of them with the tool.
    """

    kind: int
    prior: Array  # prior information in the orthonormal basis, (p, p)
    amount: float  # information per unit of G
    targets: Array  # A, (R, p) with R ≤ p
    tool_prior: Array  # prior information on a tool, (R, R)
    runs: float  # 1 or 2


class GoalBuffers(NamedTuple):
    """Scratch arrays of one thread for a goal."""

    square: Array  # eigenvectors as rows, or the inverse of the Cholesky factor of M, (p, p)
    inner: Array  # G in the orthonormal basis, (p, p)
    whole: Array  # M, then its factor, (p, p)
    values: Array  # eigenvalues in the smooth ratio, ascending, (K,)
    slopes: Array  # derivatives of the ratio by them, (K,)
    vectors: Array  # their eigenvectors, (K, p)
    vector: Array  # one direction in the orthonormal basis, (p,)
    rows: Array  # for ``eigen``
    shifts: Array  # for ``eigen``
    halves: Array  # L⁻¹ of the targets, with L Lᵀ = M, (R, p)
    small: Array  # the targets' covariance or information, then its factor, (R, R)
    weights: Array  # of the directions, (D,)
    base: Array  # the directions over the base columns, (D, p)


def goal_buffers(goal: GoalArrays) -> GoalBuffers:
    """Scratch arrays for a goal; they fit all with as many parameters and targets."""
    size, targets = len(goal.prior), len(goal.targets)
    count, most = min(size, LOWEST + HIGHEST), max(size, 2 * targets)
    rows, shifts = eigen.eigen_buffers(size, max(count, 2))
    return GoalBuffers(
        square=np.zeros((size, size)),
        inner=np.zeros((size, size)),
        whole=np.zeros((size, size)),
        values=np.zeros(count),
        slopes=np.zeros(count),
        vectors=np.zeros((count, size)),
        vector=np.zeros(size),
        rows=rows,
        shifts=shifts,
        halves=np.zeros((targets, size)),
        small=np.zeros((targets, targets)),
        weights=np.zeros(most),
        base=np.zeros((most, size)),
    )


@kernel
def _lower_transpose_times(subspace: Array, matrix: Array, out: Array) -> None:
    """Write Cᵀ A for a lower triangular C, most of whose elements are zero: these are skipped."""
    size = len(subspace)
    for i in range(size):
        clear(out[i])
    for k in range(size):
        for i in range(k + 1):
            if subspace[k, i] != 0:
                add_to(out[i], subspace[k, i], matrix[k], size)


@kernel
def to_orthonormal(subspace: Array, gram: Array, square: Array, inner: Array) -> float:
    """Write Cᵀ G C for a sparse lower triangular C and symmetric G; ``square`` is scratch.

    Returns its largest element, infinity if one of the diagonal is not finite.
    """
    size, largest, trace = len(subspace), 0.0, 0.0
    _lower_transpose_times(subspace, gram, inner)
    for i in range(size):
        for j in range(size):
            square[j, i] = inner[i, j]
    _lower_transpose_times(subspace, square, inner)  # Cᵀ (Cᵀ G)ᵀ
    for i in range(size):
        largest = max(largest, inner[i, i])  # positive semi-definite: no element is larger
        trace += inner[i, i]
        for j in range(i):
            inner[i, j] = inner[j, i]
    return largest if math.isfinite(trace) else np.inf


@kernel
def _smooth_ratio(values: Array, slopes: Array) -> float:
    """Smooth log ratio of the largest to the smallest of ascending positive values; writes its gradient.

    It is log (Σ λˢ)^(1/s) over the largest plus log (Σ λ⁻ˢ)^(1/s) over the smallest, with s = ``SHARPNESS``.
    Values are raised in place to at least the largest over ``HOPELESS``, and keep their slope there.
    """
    count, total = len(values), 0.0
    floor = max(values[count - 1] / HOPELESS, _TINY)
    for k in range(count):
        values[k], slopes[k] = max(values[k], floor), 0.0
    for side in range(2):
        some = min(count, HIGHEST if side else LOWEST)
        first, sign = (count - some, 1.0) if side else (0, -1.0)
        most = sign * math.log(values[count - 1] if side else values[0])
        sums = 0.0
        for k in range(first, first + some):
            sums += math.exp(SHARPNESS * (sign * math.log(values[k]) - most))
        for k in range(first, first + some):
            share = math.exp(SHARPNESS * (sign * math.log(values[k]) - most)) / sums
            slopes[k] += sign * share / values[k]
        total += most + math.log(sums) / SHARPNESS
    return total


@kernel
def _index_of_rank(matrix: Array, count: int, k: int) -> int:
    """Diagonal index of the k-th, in ascending order, of the ``count`` smallest and largest elements."""
    size = len(matrix)
    rank = k if k < LOWEST else size - count + k
    for i in range(size):
        smaller = 0
        for m in range(size):
            smaller += matrix[m, m] < matrix[i, i] or (matrix[m, m] == matrix[i, i] and m < i)
        if smaller == rank:
            return i
    return 0  # only for NaN


@part
def _ends(work: GoalBuffers) -> None:
    """Write the eigenpairs at both ends of the spectrum of ``inner``; ``whole``, its copy, is overwritten."""
    size, whole, count = len(work.inner), work.whole, len(work.values)
    if size > count:
        sound = eigen.extreme_eigenpairs(whole, LOWEST, work.values, work.vectors, work.rows, work.shifts)
        if sound:
            return
        for i in range(size):
            for j in range(size):
                whole[i, j] = work.inner[i, j]
    all_eigenpairs(whole, work.square)
    for k in range(count):
        i = _index_of_rank(whole, count, k)
        work.values[k] = whole[i, i]
        for m in range(size):
            work.vectors[k, m] = work.square[i, m]


@kernel
def _condition(goal: GoalArrays, subspace: Array, work: GoalBuffers) -> float:
    """Smooth log condition number of the whole matrix; writes its directions."""
    size, scale, whole = len(subspace), 0.0, work.whole
    for i in range(size):
        scale = max(scale, whole[i, i])
    for i in range(size):
        for j in range(size):
            whole[i, j] /= scale
            work.inner[i, j] = whole[i, j]
    _ends(work)
    value = _smooth_ratio(work.values, work.slopes)
    for k in range(len(work.values)):
        work.weights[k] = goal.amount * work.slopes[k] / scale
        _times(subspace, work.vectors[k], work.base[k])
    return value


@kernel
def _times(lower: Array, x: Array, out: Array) -> None:
    """Write L x for a lower triangular L, for instance to map from the orthonormal basis to base columns."""
    for i in range(len(lower)):
        out[i] = product(lower[i], x, i + 1)


@kernel
def _transpose_times(inverse: Array, half: Array, x: Array) -> None:
    """Write L⁻ᵀ half into x, for a given L⁻¹."""
    clear(x)
    for i in range(len(inverse)):
        add_to(x, half[i], inverse[i], i + 1)


@kernel
def _eliminate(factor: Array, rows: Array, size: int) -> None:
    """Multiply rows by L⁻¹ in place, for a lower triangular L."""
    for m in range(len(factor)):
        for k in range(m):
            add_to(rows[m], -factor[m, k], rows[k], size)
        for i in range(size):
            rows[m, i] /= factor[m, m]


@kernel
def _log_det(factor: Array) -> float:
    """Log determinant of L Lᵀ for a lower triangular L."""
    total = 0.0
    for m in range(len(factor)):
        total += 2 * math.log(factor[m, m])
    return total


@kernel
def _covariance(goal: GoalArrays, subspace: Array, work: GoalBuffers) -> tuple[float, int]:
    """Log trace or log determinant of the targets' covariance, and the number of directions written."""
    size, count, inverse, halves, trace = len(subspace), len(goal.targets), work.square, work.halves, 0.0
    for m in range(count):
        _times(inverse, goal.targets[m], halves[m])
        trace += product(halves[m], halves[m], size)
    if goal.kind == VOLUME:
        for m in range(count):
            for k in range(m + 1):
                work.small[m, k] = product(halves[m], halves[k], size)
        if not factorise(work.small):
            return np.inf, 0
        _eliminate(work.small, halves, size)
    for m in range(count):
        work.weights[m] = -goal.amount / (trace if goal.kind == VARIANCE else 1.0)
        _transpose_times(inverse, halves[m], work.vector)
        _times(subspace, work.vector, work.base[m])
    return math.log(trace) if goal.kind == VARIANCE else _log_det(work.small), count


@kernel
def _tool(goal: GoalArrays, subspace: Array, work: GoalBuffers) -> tuple[float, int]:
    """Log determinant of a tool's covariance, and the number of directions written.

    With U = amount · G Aᵀ, K = prior + runs · amount · G and X = K⁻¹ U, the tool's information is
    S = tool_prior + A U − Uᵀ X, and dS = amount · ((Aᵀ − X)ᵀ dG (Aᵀ − X) + (runs − 1) Xᵀ dG X).
    """
    size, count, inverse = len(subspace), len(goal.targets), work.square
    pulled, solved, halves = work.base[:count], work.base[count : 2 * count], work.halves
    for m in range(count):
        for i in range(size):
            pulled[m, i] = goal.amount * product(work.inner[i], goal.targets[m], size)
        _times(inverse, pulled[m], halves[m])
        _transpose_times(inverse, halves[m], solved[m])
        for k in range(m + 1):
            told = product(goal.targets[k], pulled[m], size) - product(halves[k], halves[m], size)
            work.small[m, k] = goal.tool_prior[m, k] + told
    if not factorise(work.small):
        return np.inf, 0
    for m in range(count):
        for i in range(size):
            pulled[m, i] = goal.targets[m, i] - solved[m, i]
    _eliminate(work.small, pulled, size)
    _eliminate(work.small, solved, size)
    for m in range(2 * count):
        work.weights[m] = -goal.amount * (1.0 if m < count else goal.runs - 1.0)
        for i in range(size):
            work.vector[i] = work.base[m, i]
        _times(subspace, work.vector, work.base[m])
    return -_log_det(work.small), 2 * count if goal.runs > 1 else count


@kernel
def goal_of(goal: GoalArrays, subspace: Array, gram: Array, work: GoalBuffers) -> tuple[float, int]:
    """Goal for a Gram matrix of the base columns (p, p), and the number of directions written.

    Infinite, without directions, if the matrix is not finite or, but for the condition number, not positive
    definite. That of a singular matrix is about log ``HOPELESS``.
    """
    scale = to_orthonormal(subspace, gram, work.square, work.inner)
    if not (math.isfinite(scale) and scale > 0):
        return np.inf, 0
    runs = goal.runs if goal.kind == TOOL else 1.0
    for i in range(len(gram)):
        for j in range(len(gram)):
            work.whole[i, j] = goal.prior[i, j] + runs * goal.amount * work.inner[i, j]
    if goal.kind == CONDITION:
        return _condition(goal, subspace, work), len(work.values)
    if not factorise(work.whole):
        return np.inf, 0
    invert_factor(work.whole, work.square)
    return _tool(goal, subspace, work) if goal.kind == TOOL else _covariance(goal, subspace, work)
