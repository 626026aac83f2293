"""The chain of links, compiled: placements, Newton–Euler steps, capsules in the world; all on tuples.

The formulas are those of ``sidegan.motion.newton_euler``, one state at a time.
"""

from typing import NamedTuple

import numpy as np

from sidegan.motion.compiled.chain import Chain, Shapes
from sidegan.motion.compiled.jit import inline
from sidegan.motion.compiled.vectors import (
    Matrix,
    Ten,
    Vector,
    add,
    cross,
    dot,
    inertia_times,
    less,
    matrix,
    mix,
    row,
    set_matrix,
    set_row,
    times,
    to_child,
    to_parent,
)

TOUCHING = 1e-12  # [m] below it a distance has no direction
_PARALLEL = 1e-15  # squared sine of an angle that is rounding noise
_TINY = 2.2250738585072014e-308  # keeps a division finite

Motion = tuple[Vector, Vector, Vector]  # angular velocity and acceleration, acceleration of the origin
Wrench = tuple[Vector, Vector]  # force and moment


class Joint(NamedTuple):
    """One joint of a ``Chain``."""

    fixed: Matrix
    sine: Matrix
    cosine: Matrix
    origin: Vector
    slide: Vector
    axis: Vector
    slides: float  # 1 or 0


class Frames(NamedTuple):
    """Frames of the base and the J joints in the world: rotations (J + 1, 9) and origins (J + 1, 3)."""

    turn: np.ndarray
    place: np.ndarray


def frames(joints: int) -> Frames:
    """Room for the frames of an arm, with the base in its place."""
    turn = np.zeros((joints + 1, 9))
    turn[0] = np.eye(3).flatten()
    return Frames(turn, np.zeros((joints + 1, 3)))


@inline
def joint(chain: Chain, i: int) -> Joint:
    """Joint i of a chain."""
    turns = matrix(chain.fixed, i), matrix(chain.sine, i), matrix(chain.cosine, i)
    moves = row(chain.origin, i), row(chain.slide, i), row(chain.axis, i)
    slides = 1.0 if chain.prismatic[i] else 0.0
    return Joint(turns[0], turns[1], turns[2], moves[0], moves[1], moves[2], slides)


@inline
def placement(j: Joint, s: float, c: float, q: float) -> tuple[Matrix, Vector]:
    """Rotation and origin of a joint's frame in its parent's, at sine and cosine of the position q."""
    r0 = mix(j.fixed[0], j.sine[0], s, c, j.cosine[0])
    r1 = mix(j.fixed[1], j.sine[1], s, c, j.cosine[1])
    r2 = mix(j.fixed[2], j.sine[2], s, c, j.cosine[2])
    return (r0, r1, r2), add(j.origin, times(q, j.slide))


@inline
def moved(j: Joint, r: Matrix, shift: Vector, dq: float, ddq: float, parent: Motion) -> Motion:
    """Motion of a link's frame, in that frame, from its parent's."""
    w, alpha, a = parent
    a = to_child(r, add(a, add(cross(alpha, shift), cross(w, cross(w, shift)))))
    w, alpha = to_child(r, w), to_child(r, alpha)
    turns = 1.0 - j.slides
    rate, kick = times(dq, j.axis), times(ddq, j.axis)
    turning = cross(w, rate)
    a = add(a, times(j.slides, add(kick, times(2.0, turning))))
    alpha = add(alpha, times(turns, add(kick, turning)))
    return add(w, times(turns, rate)), alpha, a


@inline
def wrench_of(v: Ten, motion: Motion) -> Wrench:
    """Force and moment about a link's origin that its motion takes."""
    w, alpha, a = motion
    h = v[1], v[2], v[3]
    turning = less(times(dot(w, h), w), times(dot(w, w), h))
    force = add(times(v[0], a), add(cross(alpha, h), turning))
    about = add(inertia_times(v, alpha), cross(w, inertia_times(v, w)))
    return force, add(cross(h, a), about)


@inline
def carried(r: Matrix, shift: Vector, wrench: Wrench) -> Wrench:
    """A link's wrench in its parent's frame and about its parent's origin."""
    f = to_parent(r, wrench[0])
    return f, add(to_parent(r, wrench[1]), cross(shift, f))


@inline
def locate(world: Frames, i: int, r: Matrix, shift: Vector) -> None:
    """Write the frame of joint i in the world, from its placement in its parent's."""
    base = matrix(world.turn, i)
    x = to_parent(base, (r[0][0], r[1][0], r[2][0]))
    y = to_parent(base, (r[0][1], r[1][1], r[2][1]))
    z = to_parent(base, (r[0][2], r[1][2], r[2][2]))
    set_matrix(world.turn, i + 1, ((x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2])))
    set_row(world.place, i + 1, add(row(world.place, i), to_parent(base, shift)))


@inline
def place_capsules(shapes: Shapes, world: Frames, ends: np.ndarray) -> None:
    """Write the end points of the capsules' axes in the world, and the middles between them, (3, C, 3)."""
    for k in range(len(shapes.frame)):
        i = shapes.frame[k]
        turn, place = matrix(world.turn, i), row(world.place, i)
        a = add(place, to_parent(turn, row(shapes.ends[0], k)))
        b = add(place, to_parent(turn, row(shapes.ends[1], k)))
        set_row(ends[0], k, a)
        set_row(ends[1], k, b)
        set_row(ends[2], k, times(0.5, add(a, b)))


@inline
def _share(x: float) -> float:
    return min(max(x, 0.0), 1.0)


@inline
def nearest(a1: Vector, b1: Vector, a2: Vector, b2: Vector) -> tuple[Vector, Vector]:
    """Nearest points of two segments. Source: Ericson 2005, section 5.1.9."""
    u, v, r = less(b1, a1), less(b2, a2), less(a1, a2)
    uu, vv, uv, ur, vr = dot(u, u), dot(v, v), dot(u, v), dot(u, r), dot(v, r)
    determinant = uu * vv - uv * uv
    s = 0.0
    if determinant > _PARALLEL * uu * vv:
        s = _share((uv * vr - ur * vv) / max(determinant, _TINY))
    t = _share((uv * s + vr) / max(vv, _TINY))
    s = _share((uv * t - ur) / max(uu, _TINY))
    return add(a1, times(s, u)), add(a2, times(t, v))
