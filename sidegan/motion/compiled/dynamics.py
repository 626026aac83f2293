"""Compiled dynamics: Gram matrices, torques and the slopes of torques, several states at a time.

Every loop over lanes is a loop over states whose arrays lie state by state in memory, so the compiler
turns it into vector instructions. What a block of states needs stays in the processor's cache. Such loops
end at min(width, LANES): knowing that, the compiler drops the test for negative indices.

The formulas are those of ``sidegan.motion.dynamics``; the slopes are its inverse dynamics in reverse: for
cotangents s of the torques, sᵀ τ is the sum over links of wrench · twist, where the twists are those of an
arm that moves with joint speeds s. So the adjoint of a twist is the force that the recursion carries.

All in one file: a cached function does not notice when one that it calls changes in another.
"""

import math
from typing import NamedTuple

import numpy as np

from sidegan.motion.compiled.chain import Chain
from sidegan.motion.compiled.jit import jit
from sidegan.motion.compiled.limits import Limits

LANES = 64  # most states at a time: shorter loops do not pay for their start
SPAN = 2 * LANES  # most states whose regressor is kept at a time: it stays near the processor
_VECTOR = 8  # numbers in a vector of the widest processors

# Rows of a link's block: rotation, origin, angular velocity and acceleration, acceleration of the origin.
_TURN, _SHIFT, _W, _ALPHA, _A, _LINK = 0, 9, 12, 15, 18, 21
# Rows of a joint's state: sine and cosine of the position, position, velocity, acceleration.
_SIN, _COS, _Q, _DQ, _DDQ, _STATE = 0, 1, 2, 3, 4, 5
# Rows of what reverse adds per link: adjoints of w, alpha and a; then of the state: q, dq, ddq.
_SW, _SALPHA, _SA, _SQ, _SDQ, _SDDQ, _ADJOINT = 0, 3, 6, 9, 10, 11, 12

_ANY_ORDER = {"contract", "reassoc"}

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]
Four = tuple[float, float, float, float]
Lanes = np.ndarray  # rows of LANES numbers, one after the other, (rows · LANES,)

_inline, _compiled = jit(forceinline=True), jit()
# In any order: sums over lanes are then sums of vectors.
_products, _sum = jit(fastmath=_ANY_ORDER), jit(forceinline=True, fastmath=_ANY_ORDER)


@_inline
def _load(x: Lanes, row: int, n: int) -> Vector:
    return x[row * LANES + n], x[(row + 1) * LANES + n], x[(row + 2) * LANES + n]


@_inline
def _load_turn(x: Lanes, n: int) -> Matrix:
    return _load(x, _TURN, n), _load(x, _TURN + 3, n), _load(x, _TURN + 6, n)


@_inline
def _store(x: Lanes, row: int, n: int, v: Vector) -> None:
    x[row * LANES + n] = v[0]
    x[(row + 1) * LANES + n] = v[1]
    x[(row + 2) * LANES + n] = v[2]


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
def _to_parent(r: Matrix, x: Vector) -> Vector:
    return _dot(r[0], x), _dot(r[1], x), _dot(r[2], x)


@_inline
def _to_child(r: Matrix, x: Vector) -> Vector:
    return _add(_add(_times(x[0], r[0]), _times(x[1], r[1])), _times(x[2], r[2]))


@_inline
def _vector(x: np.ndarray, i: int) -> Vector:
    return x[i, 0], x[i, 1], x[i, 2]


@_inline
def _matrix(x: np.ndarray, i: int) -> Matrix:
    row = x[i]
    return (row[0], row[1], row[2]), (row[3], row[4], row[5]), (row[6], row[7], row[8])


@_inline
def _mix(a: Vector, b: Vector, s: float, c: float, d: Vector) -> Vector:
    return _add(_add(a, _times(s, b)), _times(c, d))


@_inline
def _inertia_times(v: tuple[float, ...], x: Vector) -> Vector:
    xx, xy, yy, xz, yz, zz = v[4], v[5], v[6], v[7], v[8], v[9]
    return (
        xx * x[0] + xy * x[1] + xz * x[2],
        xy * x[0] + yy * x[1] + yz * x[2],
        xz * x[0] + yz * x[1] + zz * x[2],
    )


@_inline
def _ten(x: np.ndarray, i: int) -> tuple[float, ...]:
    return (
        x[i], x[i + 1], x[i + 2], x[i + 3], x[i + 4], x[i + 5], x[i + 6], x[i + 7], x[i + 8], x[i + 9],
    )  # fmt: skip


class Room(NamedTuple):
    """Room for one kernel at work: rows of lanes for each joint or link."""

    state: np.ndarray
    links: np.ndarray
    screws: np.ndarray
    ten: np.ndarray
    wrenches: np.ndarray
    torque: np.ndarray
    twist: np.ndarray
    adjoints: np.ndarray


def room(joints: int) -> Room:
    """Room to work on an arm of so many joints; not to be shared among threads."""
    links = joints + 1
    rows = [(joints, _STATE), (links, _LINK), (joints, 6), (10,), (joints, 6), (joints, 1), (6,)]
    return Room(*(aligned(*shape[:-1], shape[-1] * LANES) for shape in [*rows, (links, _ADJOINT)]))


def aligned(*shape: int) -> np.ndarray:
    """Zeros that begin with a line of the cache: a vector across two lines takes twice as long."""
    size = math.prod(shape)
    room = np.zeros(size + _VECTOR)
    skipped = -room.ctypes.data % (8 * _VECTOR) // 8
    return room[skipped : skipped + size].reshape(shape)


@_inline
def _step(count: int) -> int:
    """States at a time when there are ``count``: blocks of about one size, in whole vectors."""
    count = max(1, count)
    blocks = (count + LANES - 1) // LANES
    return ((count + blocks - 1) // blocks + _VECTOR - 1) // _VECTOR * _VECTOR


@_compiled
def _fill(states: np.ndarray, b: int, first: int, count: int, width: int, state: np.ndarray) -> None:
    """Copy ``count`` states of trajectory b into lanes; the last one fills up what is left."""
    for j in range(states.shape[2]):
        for r in range(_STATE):
            for n in range(count):
                state[j, r * LANES + n] = states[r, b, j, first + n]
            for n in range(count, width):
                state[j, r * LANES + n] = states[r, b, j, first + count - 1]


@_compiled
def _move(chain: Chain, i: int, state: Lanes, parent: Lanes, link: Lanes, width: int) -> None:
    """Motion of link i's frame from that of its parent's."""
    fixed, sine, cosine = _matrix(chain.fixed, i), _matrix(chain.sine, i), _matrix(chain.cosine, i)
    origin, slide, axis = _vector(chain.origin, i), _vector(chain.slide, i), _vector(chain.axis, i)
    slides = 1.0 if chain.prismatic[i] else 0.0
    turns = 1.0 - slides
    for n in range(min(width, LANES)):
        s, c = state[_SIN * LANES + n], state[_COS * LANES + n]
        r0 = _mix(fixed[0], sine[0], s, c, cosine[0])
        r1 = _mix(fixed[1], sine[1], s, c, cosine[1])
        r2 = _mix(fixed[2], sine[2], s, c, cosine[2])
        r = r0, r1, r2
        shift = _add(origin, _times(state[_Q * LANES + n], slide))
        w, alpha, a = _load(parent, _W, n), _load(parent, _ALPHA, n), _load(parent, _A, n)
        a = _to_child(r, _add(a, _add(_cross(alpha, shift), _cross(w, _cross(w, shift)))))
        w, alpha = _to_child(r, w), _to_child(r, alpha)
        rate, kick = _times(state[_DQ * LANES + n], axis), _times(state[_DDQ * LANES + n], axis)
        turning = _cross(w, rate)
        a = _add(a, _times(slides, _add(kick, _times(2.0, turning))))
        alpha = _add(alpha, _times(turns, _add(kick, turning)))
        w = _add(w, _times(turns, rate))
        _store(link, _TURN, n, r0)
        _store(link, _TURN + 3, n, r1)
        _store(link, _TURN + 6, n, r2)
        _store(link, _SHIFT, n, shift)
        _store(link, _W, n, w)
        _store(link, _ALPHA, n, alpha)
        _store(link, _A, n, a)


@_compiled
def _rest(gravity: np.ndarray, base: Lanes, width: int) -> None:
    """The base: at rest, and accelerated against gravity."""
    for n in range(min(width, LANES)):
        _store(base, _W, n, (0.0, 0.0, 0.0))
        _store(base, _ALPHA, n, (0.0, 0.0, 0.0))
        _store(base, _A, n, (-gravity[0], -gravity[1], -gravity[2]))


@_compiled
def _carry_screw(link: Lanes, screw: Lanes, width: int) -> None:
    """A joint's turn and the speed of the origin, from the parent's frame into the link's."""
    for n in range(min(width, LANES)):
        r, turn = _load_turn(link, n), _load(screw, 0, n)
        linear = _add(_load(screw, 3, n), _cross(turn, _load(link, _SHIFT, n)))
        _store(screw, 0, n, _to_child(r, turn))
        _store(screw, 3, n, _to_child(r, linear))


@_compiled
def _new_screw(axis: Vector, slides: bool, screw: Lanes, width: int) -> None:
    for n in range(min(width, LANES)):
        _store(screw, 0, n, _times(0.0 if slides else 1.0, axis))
        _store(screw, 3, n, _times(1.0 if slides else 0.0, axis))


@_compiled
def _columns(link: Lanes, screw: Lanes, ten: Lanes, width: int) -> None:
    """The link's ten columns seen by one joint."""
    for n in range(min(width, LANES)):
        w, alpha, a = _load(link, _W, n), _load(link, _ALPHA, n), _load(link, _A, n)
        turn, linear = _load(screw, 0, n), _load(screw, 3, n)
        spin = _less(_times(_dot(w, linear), w), _times(_dot(w, w), linear))
        first = _add(_add(_cross(linear, alpha), spin), _cross(a, turn))
        u = _cross(turn, w)
        ten[n] = _dot(linear, a)
        _store(ten, 1, n, first)
        ten[4 * LANES + n] = turn[0] * alpha[0] + u[0] * w[0]
        ten[5 * LANES + n] = turn[0] * alpha[1] + turn[1] * alpha[0] + u[0] * w[1] + u[1] * w[0]
        ten[6 * LANES + n] = turn[1] * alpha[1] + u[1] * w[1]
        ten[7 * LANES + n] = turn[0] * alpha[2] + turn[2] * alpha[0] + u[0] * w[2] + u[2] * w[0]
        ten[8 * LANES + n] = turn[1] * alpha[2] + turn[2] * alpha[1] + u[1] * w[2] + u[2] * w[1]
        ten[9 * LANES + n] = turn[2] * alpha[2] + u[2] * w[2]


@_compiled
def _rows(
    chain: Chain,
    states: np.ndarray,
    b: int,
    start: int,
    count: int,
    kinds: np.ndarray,
    first: np.ndarray,
    work: Room,
    y: np.ndarray,
) -> int:
    """Write the base regressor of ``count`` states from ``start`` on; how many lanes each joint takes.

    A column's row of y holds joint 0's lanes, then joint 1's, … up to the joint of its own link: the
    others do not feel it. Lanes without a state are zero.
    """
    joints = states.shape[2]
    state, links, screws, ten = work.state, work.links, work.screws, work.ten
    step = _step(count)
    span = (count + step - 1) // step * step
    for at in range(0, count, step):
        lanes = min(step, count - at)
        _fill(states, b, start + at, lanes, step, state)
        for i in range(joints):
            link = links[i + 1]
            _move(chain, i, state[i], links[i], link, step)
            _new_screw(_vector(chain.axis, i), chain.prismatic[i], screws[i], step)
            for j in range(i + 1):
                screw = screws[j]
                if j < i:
                    _carry_screw(link, screw, step)
                _columns(link, screw, ten, step)
                for k in range(first[i], first[i + 1]):
                    row, to, kind = y[k], j * span + at, kinds[k] * LANES
                    for n in range(min(lanes, LANES)):
                        row[to + n] = ten[kind + n]
                    for n in range(lanes, step):
                        row[to + n] = 0.0
    return span


@_sum
def _four(s: Four, x: float, y: Four) -> Four:
    return s[0] + x * y[0], s[1] + x * y[1], s[2] + x * y[2], s[3] + x * y[3]


@_products
def _tile(y: np.ndarray, p: int, ps: int, q: int, qs: int, low: int, high: int, out: np.ndarray) -> None:
    """Add the products of up to four rows from p on with four from q on, from ``low`` to ``high``."""
    a0, a1, a2, a3 = y[p], y[min(p + 1, ps - 1)], y[min(p + 2, ps - 1)], y[min(p + 3, ps - 1)]
    b0, b1, b2, b3 = y[q], y[min(q + 1, qs - 1)], y[min(q + 2, qs - 1)], y[min(q + 3, qs - 1)]
    s0 = s1 = s2 = s3 = (0.0, 0.0, 0.0, 0.0)
    for n in range(low, high):
        b = b0[n], b1[n], b2[n], b3[n]
        s0, s1 = _four(s0, a0[n], b), _four(s1, a1[n], b)
        s2, s3 = _four(s2, a2[n], b), _four(s3, a3[n], b)
    found = s0, s1, s2, s3
    for k in range(min(4, ps - p)):
        for m in range(min(4, qs - q)):
            out[p + k, q + m] += found[k][m]


@_compiled
def _mirror(x: np.ndarray, factor: float) -> None:
    """Multiply what is above the diagonal, and write it below too."""
    for p in range(len(x)):
        for q in range(p, len(x)):
            x[p, q] *= factor
            x[q, p] = x[p, q]


@_compiled
def grams(
    chain: Chain,
    states: np.ndarray,
    kinds: np.ndarray,
    first: np.ndarray,
    gram: np.ndarray,
    work: Room,
    y: np.ndarray,
) -> None:
    """Write the Gram matrices YᵀY / T of the base regressor of B trajectories.

    Args:
        chain: the arm.
        states: sine and cosine of the position, position, velocity, acceleration, (5, B, J, T).
        kinds: which of its link's ten parameters each base column is, (p,); links in order.
        first: first column of each link, and p at the end, (J + 1,).
        gram: written, (B, p, p); zeros before.
        work: room to work in.
        y: room for the regressor, (p, J · SPAN).
    """
    joints, count, size = states.shape[2], states.shape[3], len(kinds)
    _rest(chain.gravity, work.links[0], LANES)
    for b in range(states.shape[1]):
        for start in range(0, count, SPAN):
            span = _rows(chain, states, b, start, min(SPAN, count - start), kinds, first, work, y)
            for i in range(joints):
                for p in range(first[i], first[i + 1], 4):
                    for q in range(p, size, 4):
                        _tile(y, p, first[i + 1], q, size, 0, (i + 1) * span, gram[b])
        _mirror(gram[b], 1 / count)


@_compiled
def sums(
    chain: Chain,
    states: np.ndarray,
    torque: np.ndarray,
    kinds: np.ndarray,
    first: np.ndarray,
    found: np.ndarray,
    work: Room,
    y: np.ndarray,
) -> None:
    """Write each joint's sums of the products of base columns and torque over B trajectories.

    Args:
        chain: the arm.
        states: sine and cosine of the position, position, velocity, acceleration, (5, B, J, T).
        torque: (B, J, T).
        kinds: which of its link's ten parameters each base column is, (p,); links in order.
        first: first column of each link, and p at the end, (J + 1,).
        found: written, (J, p + 1, p + 1), torque last; zeros before.
        work: room to work in.
        y: room for the regressor and the torque, (p + 1, J · SPAN).
    """
    joints, count, size = states.shape[2], states.shape[3], len(kinds)
    _rest(chain.gravity, work.links[0], LANES)
    for b in range(states.shape[1]):
        for start in range(0, count, SPAN):
            lanes = min(SPAN, count - start)
            span = _rows(chain, states, b, start, lanes, kinds, first, work, y)
            for j in range(joints):
                for n in range(span):
                    y[size, j * span + n] = torque[b, j, start + n] if n < lanes else 0.0
            for j in range(joints):
                for p in range(first[j], size + 1, 4):
                    for q in range(p, size + 1, 4):
                        _tile(y, p, size + 1, q, size + 1, j * span, (j + 1) * span, found[j])
    for j in range(joints):
        _mirror(found[j], 1.0)


@_compiled
def _wrench(link: Lanes, v: tuple[float, ...], wrench: Lanes, width: int) -> None:
    """Force and moment about the link's origin."""
    mass, h = v[0], (v[1], v[2], v[3])
    for n in range(min(width, LANES)):
        w, alpha, a = _load(link, _W, n), _load(link, _ALPHA, n), _load(link, _A, n)
        turning = _less(_times(_dot(w, h), w), _times(_dot(w, w), h))
        _store(wrench, 0, n, _add(_times(mass, a), _add(_cross(alpha, h), turning)))
        about = _add(_inertia_times(v, alpha), _cross(w, _inertia_times(v, w)))
        _store(wrench, 3, n, _add(_cross(h, a), about))


@_compiled
def _pass_down(child: Lanes, carried: Lanes, wrench: Lanes, width: int) -> None:
    """Add what the child carries to its parent's wrench."""
    for n in range(min(width, LANES)):
        r = _load_turn(child, n)
        f = _to_parent(r, _load(carried, 0, n))
        m = _add(_to_parent(r, _load(carried, 3, n)), _cross(_load(child, _SHIFT, n), f))
        _store(wrench, 0, n, _add(_load(wrench, 0, n), f))
        _store(wrench, 3, n, _add(_load(wrench, 3, n), m))


@_compiled
def _along(axis: Vector, slides: bool, wrench: Lanes, torque: Lanes, width: int) -> None:
    """What of a wrench the joint feels."""
    for n in range(min(width, LANES)):
        torque[n] = _dot(axis, _load(wrench, 0, n) if slides else _load(wrench, 3, n))


@_compiled
def _clear(x: Lanes) -> None:
    for n in range(len(x)):  # several times as fast as x[:] = 0
        x[n] = 0.0


@_compiled
def _enter(chain: Chain, states: np.ndarray, b: int, start: int, lanes: int, width: int, work: Room) -> None:
    """Motion of all links in a block of states, with nothing known of any slope yet."""
    _fill(states, b, start, lanes, width, work.state)
    for i in range(len(chain.prismatic)):
        _move(chain, i, work.state[i], work.links[i], work.links[i + 1], width)
    for link in range(len(work.adjoints)):
        _clear(work.adjoints[link])


@_compiled
def _forces(
    chain: Chain, links: np.ndarray, v: np.ndarray, wrenches: np.ndarray, torque: np.ndarray, width: int
) -> None:
    """Carried wrenches and torques of one parameter set, (10 J,)."""
    joints = len(chain.prismatic)
    for i in range(joints):
        _wrench(links[i + 1], _ten(v, 10 * i), wrenches[i], width)
    for i in range(joints - 1, -1, -1):
        wrench = wrenches[i]
        if i + 1 < joints:
            _pass_down(links[i + 2], wrenches[i + 1], wrench, width)
        _along(_vector(chain.axis, i), chain.prismatic[i], wrench, torque[i], width)


@_compiled
def torques(chain: Chain, states: np.ndarray, sets: np.ndarray, torque: np.ndarray, work: Room) -> None:
    """Write the torques (B, K, J, T) of states (5, B, J, T) with parameter sets (B, K, 10 J)."""
    joints, count = states.shape[2], states.shape[3]
    _rest(chain.gravity, work.links[0], LANES)
    step = _step(count)
    for b in range(states.shape[1]):
        for start in range(0, count, step):
            lanes = min(step, count - start)
            _enter(chain, states, b, start, lanes, step, work)
            for k in range(sets.shape[1]):
                _forces(chain, work.links, sets[b, k], work.wrenches, work.torque, step)
                for j in range(joints):
                    for n in range(min(lanes, LANES)):
                        torque[b, k, j, start + n] = work.torque[j, n]


@_compiled
def _twist(
    chain: Chain, i: int, link: Lanes, s: Lanes, twist: Lanes, wrench: Lanes, adjoint: Lanes, width: int
) -> None:
    """The twist of link i of an arm that moves with speeds s, in place of its parent's; adds to q's slope."""
    axis, slide = _vector(chain.axis, i), _vector(chain.slide, i)
    slides = 1.0 if chain.prismatic[i] else 0.0
    turns = 1.0 - slides
    for n in range(min(width, LANES)):
        r, turn = _load_turn(link, n), _load(twist, 0, n)
        linear = _to_child(r, _add(_load(twist, 3, n), _cross(turn, _load(link, _SHIFT, n))))
        moved = _to_child(r, _cross(turn, slide))
        turn = _to_child(r, turn)
        f, m = _load(wrench, 0, n), _load(wrench, 3, n)
        twisted = _add(_cross(f, linear), _cross(m, turn))
        adjoint[_SQ * LANES + n] += turns * _dot(axis, twisted) + slides * _dot(f, moved)
        _store(twist, 0, n, _add(turn, _times(turns * s[n], axis)))
        _store(twist, 3, n, _add(linear, _times(slides * s[n], axis)))


@_compiled
def _slope_of_wrench(link: Lanes, v: tuple[float, ...], twist: Lanes, adjoint: Lanes, width: int) -> None:
    """Add the slopes of wrench · twist in the link's motion."""
    mass, h = v[0], (v[1], v[2], v[3])
    for n in range(min(width, LANES)):
        w, t, u = _load(link, _W, n), _load(twist, 0, n), _load(twist, 3, n)
        sa = _add(_times(mass, u), _cross(t, h))
        salpha = _add(_cross(h, u), _inertia_times(v, t))
        whirl = _add(_times(_dot(w, h), u), _times(_dot(u, w), h))
        whirl = _less(whirl, _times(2.0 * _dot(u, h), w))
        sw = _add(_cross(_inertia_times(v, w), t), _inertia_times(v, _cross(t, w)))
        _store(adjoint, _SA, n, _add(_load(adjoint, _SA, n), sa))
        _store(adjoint, _SALPHA, n, _add(_load(adjoint, _SALPHA, n), salpha))
        _store(adjoint, _SW, n, _add(_load(adjoint, _SW, n), _add(whirl, sw)))


@_compiled
def _unmove(
    chain: Chain, i: int, state: Lanes, parent: Lanes, link: Lanes, above: Lanes, adjoint: Lanes, width: int
) -> None:
    """Carry the adjoints of link i's motion to its parent's, and write those of the joint's state."""
    origin_moves, axis = _vector(chain.slide, i), _vector(chain.axis, i)
    slides = 1.0 if chain.prismatic[i] else 0.0
    turns = 1.0 - slides
    for n in range(min(width, LANES)):
        r, shift = _load_turn(link, n), _load(link, _SHIFT, n)
        w0, alpha0 = _load(parent, _W, n), _load(parent, _ALPHA, n)
        sw, salpha, sa = _load(adjoint, _SW, n), _load(adjoint, _SALPHA, n), _load(adjoint, _SA, n)
        dq = state[_DQ * LANES + n]
        rate, kick = _times(dq, axis), _times(state[_DDQ * LANES + n], axis)
        # w, alpha and a as they were after the rotation and before the joint's own motion.
        w = _to_child(r, w0)
        alpha = _to_child(r, alpha0)
        turning = _cross(w, rate)
        a = _less(_load(link, _A, n), _times(slides, _add(kick, _times(2.0, turning))))
        # The joint's own motion.
        sturning = _add(_times(turns, salpha), _times(2.0 * slides, sa))
        skick = _add(_times(turns, salpha), _times(slides, sa))
        srate = _add(_times(turns, sw), _cross(sturning, w))
        sw = _add(sw, _cross(rate, sturning))
        adjoint[_SDQ * LANES + n] += _dot(axis, srate)
        adjoint[_SDDQ * LANES + n] += _dot(axis, skick)
        # The rotation.
        turned = _add(_cross(sw, w), _add(_cross(salpha, alpha), _cross(sa, a)))
        slope = turns * _dot(axis, turned)
        sw, salpha, sa = _to_parent(r, sw), _to_parent(r, salpha), _to_parent(r, sa)
        # The way from the parent's origin to the link's.
        swirl = _cross(w0, shift)
        sshift = _add(_cross(sa, alpha0), _cross(_cross(sa, w0), w0))
        slope += slides * _dot(origin_moves, sshift)
        salpha = _add(salpha, _cross(shift, sa))
        sw = _add(sw, _add(_cross(swirl, sa), _cross(shift, _cross(sa, w0))))
        adjoint[_SQ * LANES + n] += slope
        _store(above, _SW, n, _add(_load(above, _SW, n), sw))
        _store(above, _SALPHA, n, _add(_load(above, _SALPHA, n), salpha))
        _store(above, _SA, n, _add(_load(above, _SA, n), sa))


@_compiled
def _push(chain: Chain, v: np.ndarray, work: Room, width: int) -> None:
    """Add the slopes of sᵀ τ to the adjoints, where s stands in place of the torques τ."""
    twist, adjoints = work.twist, work.adjoints
    _clear(twist)
    for i in range(len(chain.prismatic)):
        link, adjoint, wrench = work.links[i + 1], adjoints[i + 1], work.wrenches[i]
        _twist(chain, i, link, work.torque[i], twist, wrench, adjoint, width)
        _slope_of_wrench(link, _ten(v, 10 * i), twist, adjoint, width)


@_compiled
def _pull(chain: Chain, work: Room, slope: np.ndarray, b: int, start: int, lanes: int, width: int) -> None:
    """Carry the adjoints down to the base; write the slopes of a block in q, dq and ddq."""
    links, adjoints = work.links, work.adjoints
    for i in range(len(chain.prismatic) - 1, -1, -1):
        adjoint = adjoints[i + 1]
        _unmove(chain, i, work.state[i], links[i], links[i + 1], adjoints[i], adjoint, width)
        for r in range(3):
            for n in range(min(lanes, LANES)):
                slope[r, b, i, start + n] = adjoint[(_SQ + r) * LANES + n]


@_compiled
def slopes(
    chain: Chain, states: np.ndarray, sets: np.ndarray, cotangents: np.ndarray, slope: np.ndarray, work: Room
) -> None:
    """Write the slopes (3, B, J, T) in q, dq and ddq of a function of the torques of several sets.

    Args:
        chain: the arm.
        states: sine and cosine of the position, position, velocity, acceleration, (5, B, J, T).
        sets: parameter sets, (B, K, 10 J).
        cotangents: of the torques, (B, K, J, T).
        slope: written.
        work: room to work in.
    """
    count = states.shape[3]
    _rest(chain.gravity, work.links[0], LANES)
    step = _step(count)
    for b in range(states.shape[1]):
        for start in range(0, count, step):
            lanes = min(step, count - start)
            _enter(chain, states, b, start, lanes, step, work)
            for k in range(sets.shape[1]):
                _forces(chain, work.links, sets[b, k], work.wrenches, work.torque, step)
                for j in range(states.shape[2]):
                    for n in range(min(lanes, LANES)):
                        work.torque[j, n] = cotangents[b, k, j, start + n]
                _push(chain, sets[b, k], work, step)
            _pull(chain, work, slope, b, start, lanes, step)


@_inline
def _beyond(x: float, limit: float, reserve: float) -> float:
    """How far |x| exceeds the limit less the reserve, as a share of the limit and with x's sign; or zero."""
    return math.copysign(max(abs(x) / limit - (1.0 - reserve), 0.0), x)


@_products
def _keep(limits: Limits, work: Room, lanes: int) -> float:
    """Penalty of a block; adds its slopes in q and dq to adjoints, puts those in torques in their place."""
    total = 0.0
    for i in range(len(limits.speed)):
        state, torque, adjoint = work.state[i], work.torque[i], work.adjoints[i + 1]
        middle, room, speed, most = limits.middle[i], limits.room[i], limits.speed[i], limits.torque[i]
        for n in range(min(lanes, LANES)):
            q = _beyond(state[_Q * LANES + n] - middle, room, limits.reserve)
            dq = _beyond(state[_DQ * LANES + n], speed, limits.reserve)
            tau = _beyond(torque[n], most, limits.torque_reserve)
            adjoint[_SQ * LANES + n] += 2.0 * limits.weight / room * q
            adjoint[_SDQ * LANES + n] += 2.0 * limits.weight / speed * dq
            torque[n] = 2.0 * limits.weight / most * tau
            total += q * q + dq * dq + tau * tau
    return limits.weight * total


@_compiled
def energy_slopes(
    chain: Chain,
    limits: Limits,
    states: np.ndarray,
    sets: np.ndarray,
    weights: np.ndarray,
    value: np.ndarray,
    slope: np.ndarray,
    work: Room,
) -> None:
    """Write the slopes (3, B, J, T) of Σ weight · |τ|² over sets and time, and of what limits cost.

    Args:
        chain: the arm.
        limits: what is to be kept; costs nothing where its weight is zero.
        states: sine and cosine of the position, position, velocity, acceleration, (5, B, J, T).
        sets: parameter sets, (B, K, 10 J).
        weights: (B, K).
        value: what the limits cost is added to it, (B,).
        slope: written.
        work: room to work in.
    """
    count = states.shape[3]
    _rest(chain.gravity, work.links[0], LANES)
    step = _step(count)
    for b in range(states.shape[1]):
        for start in range(0, count, step):
            lanes = min(step, count - start)
            _enter(chain, states, b, start, lanes, step, work)
            for k in range(sets.shape[1]):
                _forces(chain, work.links, sets[b, k], work.wrenches, work.torque, step)
                for j in range(states.shape[2]):
                    for n in range(step):
                        work.torque[j, n] *= 2.0 * weights[b, k]
                _push(chain, sets[b, k], work, step)
            if limits.weight > 0:
                _forces(chain, work.links, limits.parameters, work.wrenches, work.torque, step)
                value[b] += _keep(limits, work, lanes)
                _push(chain, limits.parameters, work, step)
            _pull(chain, work, slope, b, start, lanes, step)
