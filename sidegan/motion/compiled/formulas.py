"""Rigid-body formulas on tuples, of numbers or of tensors alike: compiled kernels and plain torch share them.

Kernels compile them where they stand (``jit.share``); this file needs no numba. A cell is a time interval of
half width h around a sample; the bound of a torque's rate is the Newton–Euler recursion on norms: each
quantity x of a link carries bounds (|x|, |ẋ|), the derivative being that of its components in the link's
frame, which turns at the joint's speed.
"""

from typing import Any

Number = Any  # or a tensor
Vector = tuple[Number, Number, Number]
Matrix = tuple[Vector, Vector, Vector]  # row by row
Ten = tuple[Number, ...]  # a link's inertial parameters, in Pinocchio's order
Motion = tuple[
    Vector, Vector, Vector
]  # angular velocity and acceleration, acceleration of the origin less gravity
Wrench = tuple[Vector, Vector]  # force and moment
Bounds = tuple[Number, ...]  # |w|, its rate, |α|, its rate, |a|, its rate; or of force and moment


def add(a: Vector, b: Vector) -> Vector:
    """Sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def less(a: Vector, b: Vector) -> Vector:
    """The first vector less the second."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def times(s: Number, a: Vector) -> Vector:
    """A vector times a number."""
    return s * a[0], s * a[1], s * a[2]


def dot(a: Vector, b: Vector) -> Number:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Cross product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def to_parent(r: Matrix, x: Vector) -> Vector:
    """A vector of the frame with rotation r, in its parent's."""
    return dot(r[0], x), dot(r[1], x), dot(r[2], x)


def to_child(r: Matrix, x: Vector) -> Vector:
    """A vector of the parent's frame, in that with rotation r."""
    return add(add(times(x[0], r[0]), times(x[1], r[1])), times(x[2], r[2]))


def product(a: Matrix, b: Matrix) -> Matrix:
    """Product of two matrices."""
    return to_child(b, a[0]), to_child(b, a[1]), to_child(b, a[2])


def inertia_times(v: Ten, x: Vector) -> Vector:
    """Product of a link's inertia matrix with a vector."""
    xx, xy, yy, xz, yz, zz = v[4], v[5], v[6], v[7], v[8], v[9]
    return dot((xx, xy, xz), x), dot((xy, yy, yz), x), dot((xz, yz, zz), x)


def moved(
    axis: Vector, slides: float, r: Matrix, shift: Vector, rates: tuple[Number, Number], parent: Motion
) -> Motion:
    """Motion of a link's frame, in that frame, from its parent's and the joint's velocity and acceleration.

    Rotation and shift place the frame in its parent's; slides is 1 where the joint does, else 0.
    """
    w, alpha, a = parent
    a = to_child(r, add(a, add(cross(alpha, shift), cross(w, cross(w, shift)))))
    w, alpha = to_child(r, w), to_child(r, alpha)
    turns = 1.0 - slides
    rate, kick = times(rates[0], axis), times(rates[1], axis)
    turning = cross(w, rate)
    a = add(a, times(slides, add(kick, times(2.0, turning))))
    alpha = add(alpha, times(turns, add(kick, turning)))
    return add(w, times(turns, rate)), alpha, a


def wrench_of(v: Ten, motion: Motion) -> Wrench:
    """Force and moment about a link's origin that its motion takes."""
    w, alpha, a = motion
    h = v[1], v[2], v[3]
    turning = less(times(dot(w, h), w), times(dot(w, w), h))
    force = add(times(v[0], a), add(cross(alpha, h), turning))
    about = add(inertia_times(v, alpha), cross(w, inertia_times(v, w)))
    return force, add(cross(h, a), about)


def carried(r: Matrix, shift: Vector, wrench: Wrench) -> Wrench:
    """A link's wrench in its parent's frame and about its parent's origin."""
    f = to_parent(r, wrench[0])
    return f, add(to_parent(r, wrench[1]), cross(shift, f))


def columns_of(motion: Motion, turn: Vector, linear: Vector) -> Ten:
    """A link's ten columns of the regressor, for a joint whose unit speed turns and moves its frame so."""
    w, alpha, a = motion
    spin = less(times(dot(w, linear), w), times(dot(w, w), linear))
    h = add(add(cross(linear, alpha), spin), cross(a, turn))
    u = cross(turn, w)
    return (
        dot(linear, a),
        h[0],
        h[1],
        h[2],
        turn[0] * alpha[0] + u[0] * w[0],
        turn[0] * alpha[1] + turn[1] * alpha[0] + u[0] * w[1] + u[1] * w[0],
        turn[1] * alpha[1] + u[1] * w[1],
        turn[0] * alpha[2] + turn[2] * alpha[0] + u[0] * w[2] + u[2] * w[0],
        turn[1] * alpha[2] + turn[2] * alpha[1] + u[1] * w[2] + u[2] * w[1],
        turn[2] * alpha[2] + u[2] * w[2],
    )


def cell_bounds(dq: Number, ddq: Number, jerk: Number, half: float) -> tuple[Number, Number, Number, Number]:
    """Largest change of position and velocity in a cell, speed and acceleration, by Taylor's theorem."""
    speed, acceleration = abs(dq), abs(ddq)
    change = half * (speed + half / 2 * (acceleration + half / 3 * jerk))
    velocity_change = half * (acceleration + half / 2 * jerk)
    return change, velocity_change, speed + velocity_change, acceleration + half * jerk


def drift(rate: Number, bound: Number, half: float) -> Number:
    """Largest change in a cell of what changes at this rate at its centre, whose own rate is bounded."""
    return half * (abs(rate) + half / 2 * bound)


def link_bounds(slides: bool, v: Number, acc: Number, jerk: Number, travel: Number, parent: Bounds) -> Bounds:
    """Bounds of a link's motion from its parent's and its joint's largest speed, acceleration and jerk."""
    w, dw, al, dal, a, da = parent
    swing = al + w * w
    a, da = a + swing * travel, da + (dal + 2 * w * dw) * travel
    if slides:
        return w, dw, al, dal, a + acc + 2 * w * v, da + swing * v + jerk + 2 * (dw * v + w * acc)
    da = da + v * a
    dal = dal + v * al + jerk + (dw + v * w) * v + w * acc
    return w + v, dw + v * w + acc, al + acc + w * v, dal, a, da


def wrench_bounds(mass: Number, first: Number, spin: Number, link: Bounds) -> Bounds:
    """Bounds of the force and the moment that a link's motion takes."""
    w, dw, al, dal, a, da = link
    swing, dswing = al + w * w, dal + 2 * w * dw
    force, dforce = mass * a + first * swing, mass * da + first * dswing
    return force, dforce, first * a + spin * swing, first * da + spin * dswing


def carried_bounds(slides: bool, v: Number, travel: Number, wrench: Bounds) -> Bounds:
    """Bounds of a wrench in the frame of the link's parent."""
    f, df, n, dn = wrench
    if slides:
        return f, df, n + travel * f, dn + travel * df + v * f
    df, dn = df + v * f, dn + v * n
    return f, df, n + travel * f, dn + travel * df
