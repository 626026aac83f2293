"""Compiled access to joints of a chain and to rows of arrays, as tuples; sines and cosines of positions."""

import math
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array
from sidegan.kernels import formulas
from sidegan.kernels.chain import Chain
from sidegan.kernels.formulas import Matrix, Ten, Vector, add, scale
from sidegan.kernels.jit import inline, inline_functions, kernel

TOUCHING = 1e-12  # [m] shorter distances have no direction
_QUARTERS = 2 / math.pi  # quarter turns per radian
# A quarter turn in three parts; the first two have 33 bits, so that their integer multiples are exact.
_FIRST, _SECOND, _THIRD = 1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21
_S = tuple((-1.0) ** n / math.factorial(2 * n + 1) for n in range(9))  # of x, x³, x⁵ …
_C = tuple((-1.0) ** n / math.factorial(2 * n) for n in range(10))  # of 1, x², x⁴ …

inline_functions(formulas)


class ChainJoint(NamedTuple):
    """One joint of a ``Chain``."""

    fixed: Matrix
    sine: Matrix
    cosine: Matrix
    origin: Vector
    slide: Vector
    axis: Vector
    slides: float  # 1 or 0


@inline
def row(x: Array, i: int) -> Vector:
    """Row i of an array (N, 3)."""
    return x[i, 0], x[i, 1], x[i, 2]


@inline
def set_row(x: Array, i: int, v: Vector) -> None:
    """Write row i of an array (N, 3)."""
    x[i, 0], x[i, 1], x[i, 2] = v


@inline
def matrix(x: Array, i: int) -> Matrix:
    """Row i of an array (N, 9) as a matrix."""
    r = x[i]
    return (r[0], r[1], r[2]), (r[3], r[4], r[5]), (r[6], r[7], r[8])


@inline
def set_matrix(x: Array, i: int, m: Matrix) -> None:
    """Write row i of an array (N, 9)."""
    x[i, 0], x[i, 1], x[i, 2] = m[0]
    x[i, 3], x[i, 4], x[i, 5] = m[1]
    x[i, 6], x[i, 7], x[i, 8] = m[2]


@inline
def ten(x: Array, i: int) -> Ten:
    """Ten consecutive numbers from index i on."""
    return (
        x[i], x[i + 1], x[i + 2], x[i + 3], x[i + 4], x[i + 5], x[i + 6], x[i + 7], x[i + 8], x[i + 9],
    )  # fmt: skip


@inline
def _mix(a: Vector, b: Vector, s: float, c: float, d: Vector) -> Vector:
    """The sum a + s b + c d."""
    return add(add(a, scale(s, b)), scale(c, d))


@inline
def joint(chain: Chain, i: int) -> ChainJoint:
    """Joint i of a chain."""
    turns = matrix(chain.fixed, i), matrix(chain.sine, i), matrix(chain.cosine, i)
    moves = row(chain.origin, i), row(chain.slide, i), row(chain.axis, i)
    slides = 1.0 if chain.prismatic[i] else 0.0
    return ChainJoint(turns[0], turns[1], turns[2], moves[0], moves[1], moves[2], slides)


@inline
def placement(j: ChainJoint, s: float, c: float, q: float) -> tuple[Matrix, Vector]:
    """Rotation and origin of a joint's frame in its parent's, given sine s and cosine c of position q."""
    r0 = _mix(j.fixed[0], j.sine[0], s, c, j.cosine[0])
    r1 = _mix(j.fixed[1], j.sine[1], s, c, j.cosine[1])
    r2 = _mix(j.fixed[2], j.sine[2], s, c, j.cosine[2])
    return (r0, r1, r2), add(j.origin, scale(q, j.slide))


@kernel
def waves(x: Array, sine: Array, cosine: Array) -> None:
    """Sine and cosine of angles [rad], (N,) each, up to a million, to about one rounding error; vectorised.

    The angle minus whole quarter turns lies within ±π/4, where the Taylor series are exact to rounding.
    """
    for n in range(len(x)):
        k = np.floor(x[n] * _QUARTERS + 0.5)
        r = x[n] - k * _FIRST - k * _SECOND - k * _THIRD
        z = r * r
        s = _S[7] + z * _S[8]
        c = _C[8] + z * _C[9]
        s = _S[5] + z * (_S[6] + z * s)
        c = _C[6] + z * (_C[7] + z * c)
        s = _S[3] + z * (_S[4] + z * s)
        c = _C[4] + z * (_C[5] + z * c)
        s = _S[1] + z * (_S[2] + z * s)
        c = _C[2] + z * (_C[3] + z * c)
        s, c = r + r * z * s, 1.0 + z * (-0.5 + z * c)
        quarter = k - 4.0 * np.floor(0.25 * k)
        odd = quarter == 1.0 or quarter == 3.0
        u = c if odd else s
        v = s if odd else c
        sine[n] = -u if quarter >= 2.0 else u
        cosine[n] = -v if quarter == 1.0 or quarter == 2.0 else v
