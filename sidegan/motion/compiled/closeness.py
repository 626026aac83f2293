"""Compiled penalty for capsules that come too close to each other or to a plane, and its slope."""

import math
from typing import NamedTuple

import numpy as np

from sidegan.motion.compiled.chain import Chain
from sidegan.motion.compiled.jit import jit

_PARALLEL = 1e-15  # squared sine of an angle that is rounding noise
_TINY = 2.2250738585072014e-308  # keeps a division finite
_TOUCHING = 1e-12  # [m] below it a distance has no direction

_inline, _compiled = jit(forceinline=True), jit()

Vector = tuple[float, float, float]


class Shapes(NamedTuple):
    """Capsules and what they are kept apart from.

    Attributes:
        link: joint in whose frame a capsule lies, −1 for the base, (C,) int.
        ends: of its axis, in that frame [m], (2, C, 3).
        radius: [m], (C,).
        pairs: capsules that are kept apart, (P, 2) int.
        guarded: plane and capsule, (K, 2) int.
        planes: normal and offset [m], (R, 4).
    """

    link: np.ndarray
    ends: np.ndarray
    radius: np.ndarray
    pairs: np.ndarray
    guarded: np.ndarray
    planes: np.ndarray


def room(shapes: Shapes, joints: int) -> tuple[np.ndarray, ...]:
    """Room for the kernel at work; not to be shared among threads."""
    capsules = len(shapes.link)
    sizes = [(joints + 1, 9), (joints + 1, 3), (joints, 3), *[(capsules, 3)] * 3, (capsules,)]
    return tuple(np.zeros(size) for size in sizes)


@_inline
def _row(x: np.ndarray, i: int) -> Vector:
    return x[i, 0], x[i, 1], x[i, 2]


@_inline
def _set(x: np.ndarray, i: int, v: Vector) -> None:
    x[i, 0], x[i, 1], x[i, 2] = v


@_inline
def _add(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@_inline
def _less(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@_inline
def _times(s: float, a: Vector) -> Vector:
    return s * a[0], s * a[1], s * a[2]


@_inline
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@_inline
def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@_inline
def _turned(world: np.ndarray, i: int, v: Vector) -> Vector:
    """A vector of a frame in the world's."""
    return (
        world[i, 0] * v[0] + world[i, 1] * v[1] + world[i, 2] * v[2],
        world[i, 3] * v[0] + world[i, 4] * v[1] + world[i, 5] * v[2],
        world[i, 6] * v[0] + world[i, 7] * v[1] + world[i, 8] * v[2],
    )


@_inline
def _within(x: float) -> float:
    return min(max(x, 0.0), 1.0)


@_compiled
def _place_joints(
    chain: Chain, states: np.ndarray, b: int, t: int, world: np.ndarray, place: np.ndarray, axes: np.ndarray
) -> None:
    """Rotations (J + 1, 9) and origins (J + 1, 3) of the base and all joints, and the joints' axes (J, 3)."""
    for i in range(states.shape[2]):
        s, c, q = states[0, b, i, t], states[1, b, i, t], states[2, b, i, t]
        shift = _add(_row(chain.origin, i), _times(q, _row(chain.slide, i)))
        _set(place, i + 1, _add(_row(place, i), _turned(world, i, shift)))
        for k in range(3):
            x = chain.fixed[i, k] + s * chain.sine[i, k] + c * chain.cosine[i, k]
            y = chain.fixed[i, 3 + k] + s * chain.sine[i, 3 + k] + c * chain.cosine[i, 3 + k]
            z = chain.fixed[i, 6 + k] + s * chain.sine[i, 6 + k] + c * chain.cosine[i, 6 + k]
            column = _turned(world, i, (x, y, z))
            world[i + 1, k], world[i + 1, 3 + k], world[i + 1, 6 + k] = column
        _set(axes, i, _turned(world, i + 1, _row(chain.axis, i)))


@_inline
def _nearest(a1: Vector, b1: Vector, a2: Vector, b2: Vector) -> tuple[Vector, Vector]:
    """Nearest points of two segments. Source: Ericson 2005, section 5.1.9."""
    u, v, r = _less(b1, a1), _less(b2, a2), _less(a1, a2)
    uu, vv, uv, ur, vr = _dot(u, u), _dot(v, v), _dot(u, v), _dot(u, r), _dot(v, r)
    determinant = uu * vv - uv * uv
    s = 0.0
    if determinant > _PARALLEL * uu * vv:
        s = _within((uv * vr - ur * vv) / max(determinant, _TINY))
    t = _within((uv * s + vr) / max(vv, _TINY))
    s = _within((uv * t - ur) / max(uu, _TINY))
    return _add(a1, _times(s, u)), _add(a2, _times(t, v))


@_compiled
def _push(
    chain: Chain,
    place: np.ndarray,
    axes: np.ndarray,
    link: int,
    point: Vector,
    force: Vector,
    slope: np.ndarray,
    b: int,
    t: int,
) -> None:
    """Add the slope in the positions of what has a slope ``force`` in a point of a link."""
    for j in range(link + 1):
        axis = _row(axes, j)
        if chain.prismatic[j]:
            slope[b, j, t] += _dot(axis, force)
        else:
            slope[b, j, t] += _dot(_cross(axis, _less(point, _row(place, j + 1))), force)


@_compiled
def closeness(
    chain: Chain,
    shapes: Shapes,
    states: np.ndarray,
    reach: float,
    value: np.ndarray,
    slope: np.ndarray,
    world: np.ndarray,
    place: np.ndarray,
    axes: np.ndarray,
    a: np.ndarray,
    b: np.ndarray,
    middle: np.ndarray,
    size: np.ndarray,
) -> None:
    """Add the squares of how far distances fall below ``reach`` [m], summed over time, and their slopes.

    Args:
        chain: the arm.
        shapes: its capsules.
        states: sine and cosine of the position, position, and more, (≥ 3, B, J, T).
        reach: smallest distance that costs nothing [m].
        value: added to [m²], (B,).
        slope: added to [m²/rad], (B, J, T).
        world: this and what follows is ``room`` to work in.
        place: of the frames.
        axes: of the joints.
        a: one end of each capsule.
        b: the other end.
        middle: between them.
        size: radius of the ball around each capsule.
    """
    count = len(shapes.link)
    for i in range(9):
        world[0, i] = 1.0 if i % 4 == 0 else 0.0
    _set(place, 0, (0.0, 0.0, 0.0))
    for k in range(count):
        half = _times(0.5, _less(_row(shapes.ends[1], k), _row(shapes.ends[0], k)))
        size[k] = math.sqrt(_dot(half, half)) + shapes.radius[k]
    for n in range(states.shape[1]):
        for t in range(states.shape[3]):
            _place_joints(chain, states, n, t, world, place, axes)
            for k in range(count):
                i = shapes.link[k] + 1
                _set(a, k, _add(_row(place, i), _turned(world, i, _row(shapes.ends[0], k))))
                _set(b, k, _add(_row(place, i), _turned(world, i, _row(shapes.ends[1], k))))
                _set(middle, k, _times(0.5, _add(_row(a, k), _row(b, k))))
            for p in range(len(shapes.pairs)):
                i, k = shapes.pairs[p, 0], shapes.pairs[p, 1]
                apart, far = _less(_row(middle, i), _row(middle, k)), reach + size[i] + size[k]
                if _dot(apart, apart) >= far * far:
                    continue
                one, two = _nearest(_row(a, i), _row(b, i), _row(a, k), _row(b, k))
                gap = _less(one, two)
                distance = math.sqrt(_dot(gap, gap))
                excess = reach - max(distance, _TOUCHING) + shapes.radius[i] + shapes.radius[k]
                if excess > 0:
                    value[n] += excess * excess
                    if distance > _TOUCHING:
                        force = _times(-2 * excess / distance, gap)
                        _push(chain, place, axes, shapes.link[i], one, force, slope, n, t)
                        _push(chain, place, axes, shapes.link[k], two, _times(-1.0, force), slope, n, t)
            for p in range(len(shapes.guarded)):
                r, k = shapes.guarded[p, 0], shapes.guarded[p, 1]
                normal = _row(shapes.planes, r)
                low, high = _dot(normal, _row(a, k)), _dot(normal, _row(b, k))
                excess = reach - min(low, high) + shapes.planes[r, 3] + shapes.radius[k]
                if excess > 0:
                    value[n] += excess * excess
                    point = _row(a, k) if low < high else _row(b, k)
                    force = _times(-2 * excess, normal)
                    _push(chain, place, axes, shapes.link[k], point, force, slope, n, t)
