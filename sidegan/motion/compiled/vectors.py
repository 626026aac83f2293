"""Vectors and rotations as tuples of numbers, which compiled code keeps in registers."""

import numpy as np

from sidegan.motion.compiled.jit import inline

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]  # row by row
Ten = tuple[float, ...]  # a link's inertial parameters, in Pinocchio's order


@inline
def add(a: Vector, b: Vector) -> Vector:
    """Sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inline
def less(a: Vector, b: Vector) -> Vector:
    """The first vector less the second."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inline
def times(s: float, a: Vector) -> Vector:
    """A vector times a number."""
    return s * a[0], s * a[1], s * a[2]


@inline
def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inline
def cross(a: Vector, b: Vector) -> Vector:
    """Cross product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inline
def to_parent(r: Matrix, x: Vector) -> Vector:
    """A vector of the frame with rotation r, in its parent's."""
    return dot(r[0], x), dot(r[1], x), dot(r[2], x)


@inline
def to_child(r: Matrix, x: Vector) -> Vector:
    """A vector of the parent's frame, in that with rotation r."""
    return add(add(times(x[0], r[0]), times(x[1], r[1])), times(x[2], r[2]))


@inline
def mix(a: Vector, b: Vector, s: float, c: float, d: Vector) -> Vector:
    """The sum a + s b + c d."""
    return add(add(a, times(s, b)), times(c, d))


@inline
def inertia_times(v: Ten, x: Vector) -> Vector:
    """Product of a link's inertia matrix with a vector."""
    xx, xy, yy, xz, yz, zz = v[4], v[5], v[6], v[7], v[8], v[9]
    return dot((xx, xy, xz), x), dot((xy, yy, yz), x), dot((xz, yz, zz), x)


@inline
def row(x: np.ndarray, i: int) -> Vector:
    """Row i of an array (N, 3)."""
    return x[i, 0], x[i, 1], x[i, 2]


@inline
def set_row(x: np.ndarray, i: int, v: Vector) -> None:
    """Write row i of an array (N, 3)."""
    x[i, 0], x[i, 1], x[i, 2] = v


@inline
def matrix(x: np.ndarray, i: int) -> Matrix:
    """Row i of an array (N, 9) as a matrix."""
    r = x[i]
    return (r[0], r[1], r[2]), (r[3], r[4], r[5]), (r[6], r[7], r[8])


@inline
def set_matrix(x: np.ndarray, i: int, m: Matrix) -> None:
    """Write row i of an array (N, 9)."""
    x[i, 0], x[i, 1], x[i, 2] = m[0]
    x[i, 3], x[i, 4], x[i, 5] = m[1]
    x[i, 6], x[i, 7], x[i, 8] = m[2]


@inline
def ten(x: np.ndarray, i: int) -> Ten:
    """Ten numbers from index i on."""
    return (
        x[i], x[i + 1], x[i + 2], x[i + 3], x[i + 4], x[i + 5], x[i + 6], x[i + 7], x[i + 8], x[i + 9],
    )  # fmt: skip
