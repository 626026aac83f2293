"""Compiled access to the joints of a chain and to rows of arrays, as tuples."""

from typing import NamedTuple

from sidegan.base.arrays import Array
from sidegan.kernels import formulas
from sidegan.kernels.chain import Chain
from sidegan.kernels.formulas import Matrix, Ten, Vector, add, times
from sidegan.kernels.jit import inline, share

TOUCHING = 1e-12  # [m] shorter distances have no direction

share(formulas)


class Joint(NamedTuple):
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
    return add(add(a, times(s, b)), times(c, d))


@inline
def joint(chain: Chain, i: int) -> Joint:
    """Joint i of a chain."""
    turns = matrix(chain.fixed, i), matrix(chain.sine, i), matrix(chain.cosine, i)
    moves = row(chain.origin, i), row(chain.slide, i), row(chain.axis, i)
    slides = 1.0 if chain.prismatic[i] else 0.0
    return Joint(turns[0], turns[1], turns[2], moves[0], moves[1], moves[2], slides)


@inline
def placement(j: Joint, s: float, c: float, q: float) -> tuple[Matrix, Vector]:
    """Rotation and origin of a joint's frame in its parent's, given sine s and cosine c of position q."""
    r0 = _mix(j.fixed[0], j.sine[0], s, c, j.cosine[0])
    r1 = _mix(j.fixed[1], j.sine[1], s, c, j.cosine[1])
    r2 = _mix(j.fixed[2], j.sine[2], s, c, j.cosine[2])
    return (r0, r1, r2), add(j.origin, times(q, j.slide))
