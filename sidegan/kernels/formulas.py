"""Rigid-body formulas on tuples of numbers, shared by all kernels.

Kernels inline them (``jit.inline_functions``); this file does not need numba. A rate is the time derivative
of a vector's components in the frame that it is written in; a link's frame turns at the joint's speed in its
parent's, which adds a cross product when components move between frames. A cell is a time interval
around a sample. Bounds on torque changes in a cell come from the Newton–Euler recursion on norms: each
quantity x of a link carries bounds on (|x|, |ẋ|, |ẍ|). All is in SI units; of prismatic joints, m in place
of rad and N in place of N·m.
"""

from typing import Any

Scalar = Any  # a number, or an array of numbers for several states
Vector = tuple[Scalar, Scalar, Scalar]
Matrix = tuple[Vector, Vector, Vector]  # row by row
# Mass, first moments, and inertia xx, xy, yy, xz, yz, zz about the link's origin.
Ten = tuple[Scalar, ...]
# Angular velocity and acceleration, acceleration of the origin minus gravity.
LinkMotion = tuple[Vector, Vector, Vector]
Moving = tuple[LinkMotion, LinkMotion]  # a motion and its rate
Wrench = tuple[Vector, Vector]  # force and moment
JointBounds = tuple[Scalar, Scalar, Scalar, Scalar]  # on a joint's speed, acceleration, jerk and snap
Bounds = tuple[Scalar, Scalar, Scalar]  # on the norms of a vector, its rate and the rate of its rate
MotionBounds = tuple[Bounds, Bounds, Bounds]  # of the vectors of a motion
WrenchBounds = tuple[Bounds, Bounds]


def add(a: Vector, b: Vector) -> Vector:
    """Sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def less(a: Vector, b: Vector) -> Vector:
    """Difference of two vectors, a − b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scale(s: Scalar, a: Vector) -> Vector:
    """A vector times a number."""
    return s * a[0], s * a[1], s * a[2]


def dot(a: Vector, b: Vector) -> Scalar:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Cross product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def to_parent(r: Matrix, x: Vector) -> Vector:
    """Rotate a vector from the frame with rotation r to its parent's."""
    return dot(r[0], x), dot(r[1], x), dot(r[2], x)


def to_child(r: Matrix, x: Vector) -> Vector:
    """Rotate a vector from the parent's frame to that with rotation r."""
    return add(add(scale(x[0], r[0]), scale(x[1], r[1])), scale(x[2], r[2]))


def matrix_product(a: Matrix, b: Matrix) -> Matrix:
    """Product of two matrices."""
    return to_child(b, a[0]), to_child(b, a[1]), to_child(b, a[2])  # row by row: (a b)ᵢ = bᵀ aᵢ


def inertia_times(link: Ten, x: Vector) -> Vector:
    """Product of a link's inertia matrix with a vector."""
    xx, xy, yy, xz, yz, zz = link[4], link[5], link[6], link[7], link[8], link[9]
    return dot((xx, xy, xz), x), dot((xy, yy, yz), x), dot((xz, yz, zz), x)


def link_motion(
    axis: Vector, slides: float, r: Matrix, shift: Vector, rates: tuple[Scalar, Scalar], parent: LinkMotion
) -> LinkMotion:
    """Motion of a link's frame, in that frame, from its parent's and the joint's velocity and acceleration.

    Rotation r and shift place the frame in its parent's; slides is 1 for a prismatic joint, else 0.
    """
    w, alpha, a = parent
    a = to_child(r, add(a, add(cross(alpha, shift), cross(w, cross(w, shift)))))
    w, alpha = to_child(r, w), to_child(r, alpha)
    turns = 1.0 - slides
    velocity, acceleration = scale(rates[0], axis), scale(rates[1], axis)
    coriolis = cross(w, velocity)
    a = add(a, scale(slides, add(acceleration, scale(2.0, coriolis))))
    alpha = add(alpha, scale(turns, add(acceleration, coriolis)))
    return add(w, scale(turns, velocity)), alpha, a


def wrench_of(link: Ten, motion: LinkMotion) -> Wrench:
    """Force and moment about a link's origin that its motion requires."""
    w, alpha, a = motion
    h = link[1], link[2], link[3]
    centripetal = less(scale(dot(w, h), w), scale(dot(w, w), h))
    force = add(scale(link[0], a), add(cross(alpha, h), centripetal))
    about = add(inertia_times(link, alpha), cross(w, inertia_times(link, w)))
    return force, add(cross(h, a), about)


def wrench_in_parent(r: Matrix, shift: Vector, wrench: Wrench) -> Wrench:
    """Transform a link's wrench to its parent's frame and origin."""
    f = to_parent(r, wrench[0])
    return f, add(to_parent(r, wrench[1]), cross(shift, f))


def link_motion_rate(
    axis: Vector, slides: float, r: Matrix, shifts: tuple[Vector, Vector], rates: Vector, parent: Moving
) -> Moving:
    """``link_motion`` and its rate, from the parent's motion and its rate.

    ``shifts`` holds the shift and its rate; ``rates`` the joint's velocity, acceleration and jerk.
    """
    (s, ds), (v, acc, jerk) = shifts, rates
    (w, al, a), (dw, dal, da) = parent
    # The motion, and its parts again in the parent's frame, since their rates are needed.
    motion = link_motion(axis, slides, r, s, (v, acc), parent[0])
    sweep = cross(w, s)
    dsweep = add(cross(dw, s), cross(w, ds))
    a = add(a, add(cross(al, s), cross(w, sweep)))
    da = add(da, add(add(cross(dal, s), cross(al, ds)), add(cross(dw, sweep), cross(w, dsweep))))
    turns = 1.0 - slides
    velocity, acceleration, jolt = scale(v, axis), scale(acc, axis), scale(jerk, axis)
    spin = scale(turns, velocity)
    w, al, a = to_child(r, w), to_child(r, al), to_child(r, a)
    dw, dal = less(to_child(r, dw), cross(spin, w)), less(to_child(r, dal), cross(spin, al))
    da = less(to_child(r, da), cross(spin, a))
    coriolis = add(cross(dw, velocity), cross(w, acceleration))
    da = add(da, scale(slides, add(jolt, scale(2.0, coriolis))))
    dal = add(dal, scale(turns, add(jolt, coriolis)))
    return motion, (add(dw, scale(turns, acceleration)), dal, da)


def wrench_rate(link: Ten, at: Moving) -> Wrench:
    """Rates of the force and the moment that a link's motion requires, from the motion and its rate."""
    (w, _, _), (dw, dal, da) = at
    h = link[1], link[2], link[3]
    centripetal = add(scale(dot(dw, h), w), scale(dot(w, h), dw))
    centripetal = less(centripetal, scale(2.0 * dot(w, dw), h))
    force = add(scale(link[0], da), add(cross(dal, h), centripetal))
    about = add(cross(dw, inertia_times(link, w)), cross(w, inertia_times(link, dw)))
    return force, add(cross(h, da), add(inertia_times(link, dal), about))


def wrench_rate_in_parent(
    spin: Vector, r: Matrix, shifts: tuple[Vector, Vector], wrench: Wrench, rate: Wrench
) -> Wrench:
    """Rate of ``wrench_in_parent``, from a wrench and its rate in a frame that turns at ``spin`` [rad/s]."""
    (f, n), (df, dn), (s, ds) = wrench, rate, shifts
    df = to_parent(r, add(df, cross(spin, f)))
    dn = to_parent(r, add(dn, cross(spin, n)))
    return df, add(dn, add(cross(ds, to_parent(r, f)), cross(s, df)))


def regressor_entries(motion: LinkMotion, angular: Vector, linear: Vector) -> Ten:
    """A link's ten regressor entries for a joint that, at unit speed, gives its frame this twist."""
    w, alpha, a = motion
    centripetal = less(scale(dot(w, linear), w), scale(dot(w, w), linear))
    h = add(add(cross(linear, alpha), centripetal), cross(a, angular))
    u = cross(angular, w)
    return (
        dot(linear, a),
        h[0],
        h[1],
        h[2],
        angular[0] * alpha[0] + u[0] * w[0],
        angular[0] * alpha[1] + angular[1] * alpha[0] + u[0] * w[1] + u[1] * w[0],
        angular[1] * alpha[1] + u[1] * w[1],
        angular[0] * alpha[2] + angular[2] * alpha[0] + u[0] * w[2] + u[2] * w[0],
        angular[1] * alpha[2] + angular[2] * alpha[1] + u[1] * w[2] + u[2] * w[1],
        angular[2] * alpha[2] + u[2] * w[2],
    )


def largest_change(rate: Scalar, bound: Scalar, half: float) -> Scalar:
    """Largest change in a cell of half width h of a quantity x, h (|ẋ| + h/2 |ẍ|), from ẋ at its centre.

    ``bound`` is that on |ẍ|.
    """
    return half * (abs(rate) + half / 2 * bound)


def product_bounds(a: Bounds, b: Bounds) -> Bounds:
    """Bounds on a product of any kind: scalar, cross or matrix product."""
    return a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[0] * b[2] + 2 * a[1] * b[1] + a[2] * b[0]


def rotate_bounds(own: JointBounds, a: Bounds) -> Bounds:
    """Bounds on a vector rotated by a joint from the parent's frame to the link's, or back."""
    v, acc = own[0], own[1]
    return a[0], a[1] + v * a[0], a[2] + 2 * v * a[1] + (acc + v * v) * a[0]


def link_bounds(slides: bool, own: JointBounds, travel: Scalar, parent: MotionBounds) -> MotionBounds:
    """Bounds on a link's motion from those on its parent's and its joint's.

    ``travel`` bounds the distance between the two origins.
    """
    w, al, a = parent
    v, acc, jerk, snap = own
    # bounds on α × + ω × ω ×, which gives the acceleration of a point fixed in the parent
    swing = add(al, product_bounds(w, w))
    velocity, acceleration = (v, acc, jerk), (acc, jerk, snap)
    if slides:
        a = add(a, product_bounds(swing, (travel, v, acc)))
        return w, al, add(a, add(acceleration, scale(2.0, product_bounds(w, velocity))))
    a = rotate_bounds(own, add(a, scale(travel, swing)))
    w, al = rotate_bounds(own, w), rotate_bounds(own, al)
    return add(w, velocity), add(al, add(acceleration, product_bounds(w, velocity))), a


def wrench_bounds(mass: Scalar, first: Scalar, inertia: Scalar, link: MotionBounds) -> WrenchBounds:
    """Bounds on the force and the moment that a link's motion requires.

    ``first`` and ``inertia`` are the norms of its first moment and of its inertia matrix.
    """
    w, al, a = link
    swing = add(al, product_bounds(w, w))
    return add(scale(mass, a), scale(first, swing)), add(scale(first, a), scale(inertia, swing))


def wrench_bounds_in_parent(
    slides: bool, own: JointBounds, travel: Scalar, wrench: WrenchBounds
) -> WrenchBounds:
    """Bounds on a link's wrench in its parent's frame and about its parent's origin."""
    f, n = wrench
    if slides:
        return f, add(n, product_bounds((travel, own[0], own[1]), f))
    f, n = rotate_bounds(own, f), rotate_bounds(own, n)
    return f, add(n, scale(travel, f))
