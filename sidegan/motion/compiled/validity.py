"""Margins of every constraint in many cells of many trajectories, one state at a time, in registers.

The compiled twin of the torch code in ``sidegan.validity``, which remains the reference: the same margins,
the same bounds of their change within a cell, the same smallest margins. What can neither be its
trajectory's smallest margin nor leave a cell undecided is skipped after a cheap test that proves as much.

Vectors are tuples of three numbers; what outlives a joint lies in ``Work``. All is in one file because
numba's cache of a function does not notice when one that it calls changes in another file.
"""

import math
from typing import NamedTuple

import numpy as np

from sidegan.motion.compiled.jit import jit

POSITION, VELOCITY, TORQUE, COLLISION, KEEP_OUT = range(5)  # columns of the margins
PLANE, BOX = range(2)  # kinds of regions

_PARALLEL = 1e-15  # squared sine of an angle that is rounding noise
_TINY = 2.2250738585072014e-308  # keeps a division finite
_TOUCHING = 1e-12  # [m] smallest distance told
_HALVINGS = 36  # of a capsule's axis at a box: leaves 1e-11 of its length

_seldom = jit()
_inline = jit(forceinline=True)  # a call would pass some two hundred numbers
_sum = jit(forceinline=True, fastmath={"contract", "reassoc"})

Vector = tuple[float, float, float]


class Model(NamedTuple):
    """An arm in its workspace as arrays, float64 where nothing else is said.

    Attributes:
        prismatic: whether a joint slides, (J,) bool.
        fixed: with ``sine`` and ``cosine`` the rotation of a joint's frame in its parent's,
            ``fixed + sine sin q + cosine cos q``, (J, 3, 3).
        sine: (J, 3, 3).
        cosine: (J, 3, 3).
        origin: with ``slide`` the frame's origin in its parent's, ``origin + slide q``, (J, 3) [m].
        slide: (J, 3).
        axis: joint axis in its own frame, (J, 3).
        inertia: ten parameters per link, (J, 10).
        gravity: (3,) [m/s²].
        home: (J,) [rad or m].
        lower: position limits, (J,).
        upper: position limits, (J,).
        speed: velocity limits, (J,).
        torque: torque limits, (J,); infinite where nothing is limited.
        link: frame of each capsule, 0 for the base, (C,) int.
        a: one end of each capsule's axis in its link's frame, (C, 3) [m].
        b: the other end, (C, 3) [m].
        radius: (C,) [m].
        size: a little more than the radius of the ball around a capsule, (C,) [m].
        pairs: capsules checked against each other, (P, 2) int.
        pair_reach: how far the motion of a joint moves two capsules against each other, (P, J).
        pair_most: the largest of all pairs, (1, J).
        guarded: region and capsule, (K, 2) int.
        region_reach: how far the motion of a joint moves a capsule, (K, J).
        region_most: the largest of all, (1, J).
        kinds: of the regions, (R,) int.
        regions: normal and offset of a plane, centre and half size of a box, (R, 6).
        travel: upper bound of the distance between a joint's frame and its parent's, (J,) [m].
        mass: absolute, (J,) [kg].
        first: norm of the first moment of mass, (J,).
        spin: spectral norm of the inertia matrix, (J,).
    """

    prismatic: np.ndarray
    fixed: np.ndarray
    sine: np.ndarray
    cosine: np.ndarray
    origin: np.ndarray
    slide: np.ndarray
    axis: np.ndarray
    inertia: np.ndarray
    gravity: np.ndarray
    home: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    speed: np.ndarray
    torque: np.ndarray
    link: np.ndarray
    a: np.ndarray
    b: np.ndarray
    radius: np.ndarray
    size: np.ndarray
    pairs: np.ndarray
    pair_reach: np.ndarray
    pair_most: np.ndarray
    guarded: np.ndarray
    region_reach: np.ndarray
    region_most: np.ndarray
    kinds: np.ndarray
    regions: np.ndarray
    travel: np.ndarray
    mass: np.ndarray
    first: np.ndarray
    spin: np.ndarray


class Work(NamedTuple):
    """What one step leaves for the next; each thread needs its own.

    Attributes:
        state: position, velocity, acceleration, (3, J).
        motion: bounds of position change, velocity change, speed and acceleration in a cell, (4, J).
        most: the largest such bounds of a trajectory, (4, J).
        turn: rotation of a joint's frame in its parent's, (J, 3, 3).
        shift: its origin there, (J, 3).
        world: rotation of a joint's frame in the world, the base's first, (J + 1, 3, 3).
        place: its origin there, (J + 1, 3).
        wrench: force and moment on a link, (2, J, 3).
        torque: (J,).
        sums: bounds of a link's force, its rate, moment and its rate, (4, J).
        rate: bound of the torques' rates in a cell, (J,).
        cap: the same for all cells of a trajectory, (J,).
        ends: end points of the capsules' axes, and the middles between them, (3, C, 3).
    """

    state: np.ndarray
    motion: np.ndarray
    most: np.ndarray
    turn: np.ndarray
    shift: np.ndarray
    world: np.ndarray
    place: np.ndarray
    wrench: np.ndarray
    torque: np.ndarray
    sums: np.ndarray
    rate: np.ndarray
    cap: np.ndarray
    ends: np.ndarray


class Smallest(NamedTuple):
    """Smallest margins so far, one row per trajectory and one column per constraint, (B, 5) each.

    Attributes:
        margin: the margins.
        element: joint, pair or guarded capsule that each belongs to, int.
        time: when it occurs [s].
    """

    margin: np.ndarray
    element: np.ndarray
    time: np.ndarray


def work_space(model: Model) -> Work:
    """Arrays that one thread needs for a model."""
    j = len(model.home)
    shapes = {"state": (3, j), "turn": (j, 3, 3), "shift": (j, 3), "world": (j + 1, 3, 3)}
    shapes |= {"place": (j + 1, 3), "wrench": (2, j, 3), "ends": (3, len(model.radius), 3)}
    shapes |= dict.fromkeys(("motion", "most", "sums"), (4, j)) | dict.fromkeys(
        ("torque", "rate", "cap"), (j,)
    )
    work = Work(**{name: np.zeros(shape) for name, shape in shapes.items()})
    work.world[0] = np.eye(3)
    return work


@_inline
def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@_inline
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@_inline
def _add(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@_inline
def _less(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@_inline
def _times(a: Vector, s: float) -> Vector:
    return a[0] * s, a[1] * s, a[2] * s


@_inline
def _between(a: Vector, b: Vector, s: float) -> Vector:
    return a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2])


@_inline
def _row(x: np.ndarray, i: int) -> Vector:
    return x[i, 0], x[i, 1], x[i, 2]


@_inline
def _of(x: np.ndarray, k: int, i: int) -> Vector:
    return x[k, i, 0], x[k, i, 1], x[k, i, 2]


@_inline
def _keep(x: np.ndarray, k: int, i: int, v: Vector) -> None:
    x[k, i, 0], x[k, i, 1], x[k, i, 2] = v


@_inline
def _turned(m: np.ndarray, i: int, x: Vector) -> Vector:
    """A vector of the child's frame, in the parent's, by the rotation m[i]."""
    return _dot(_of(m, i, 0), x), _dot(_of(m, i, 1), x), _dot(_of(m, i, 2), x)


@_inline
def _turned_back(m: np.ndarray, i: int, x: Vector) -> Vector:
    """A vector of the parent's frame, in the child's, by the rotation m[i]."""
    return (
        m[i, 0, 0] * x[0] + m[i, 1, 0] * x[1] + m[i, 2, 0] * x[2],
        m[i, 0, 1] * x[0] + m[i, 1, 1] * x[1] + m[i, 2, 1] * x[2],
        m[i, 0, 2] * x[0] + m[i, 1, 2] * x[1] + m[i, 2, 2] * x[2],
    )


@_sum
def _roll_out(
    home: np.ndarray, c: np.ndarray, n: int, basis: np.ndarray, row: int, state: np.ndarray
) -> None:
    """State (3, J) of trajectory n, coefficients (B, J, K), at a row of the basis, (T, 3, K)."""
    for j in range(c.shape[1]):
        q, dq, ddq = home[j], 0.0, 0.0
        for k in range(c.shape[2]):
            q += basis[row, 0, k] * c[n, j, k]
            dq += basis[row, 1, k] * c[n, j, k]
            ddq += basis[row, 2, k] * c[n, j, k]
        state[0, j], state[1, j], state[2, j] = q, dq, ddq


@_inline
def _cell_motion(state: np.ndarray, jerk: np.ndarray, n: int, half: float, motion: np.ndarray) -> None:
    """Bounds of the motion in a cell of half width ``half`` [s], by Taylor's theorem."""
    for j in range(jerk.shape[1]):
        dq, ddq = abs(state[1, j]), abs(state[2, j])
        motion[0, j] = half * (dq + half / 2 * (ddq + half / 3 * jerk[n, j]))
        motion[1, j] = half * (ddq + half / 2 * jerk[n, j])
        motion[2, j] = dq + motion[1, j]
        motion[3, j] = ddq + half * jerk[n, j]


@_inline
def _place_joints(model: Model, work: Work) -> None:
    """Frames of the joints, in their parents and in the world."""
    turn, shift, world, place = work.turn, work.shift, work.world, work.place
    for i in range(len(model.home)):
        q = work.state[0, i]
        s, c = math.sin(q), math.cos(q)
        for row in range(3):
            shift[i, row] = model.origin[i, row] + model.slide[i, row] * q
            for k in range(3):
                turning = model.sine[i, row, k] * s + model.cosine[i, row, k] * c
                turn[i, row, k] = model.fixed[i, row, k] + turning
        for k in range(3):
            x = _turned(world, i, (turn[i, 0, k], turn[i, 1, k], turn[i, 2, k]))
            world[i + 1, 0, k], world[i + 1, 1, k], world[i + 1, 2, k] = x
        x = _add(_row(place, i), _turned(world, i, _row(shift, i)))
        place[i + 1, 0], place[i + 1, 1], place[i + 1, 2] = x


@_inline
def _inertia_times(v: np.ndarray, i: int, x: Vector) -> Vector:
    return (
        v[i, 4] * x[0] + v[i, 5] * x[1] + v[i, 7] * x[2],
        v[i, 5] * x[0] + v[i, 6] * x[1] + v[i, 8] * x[2],
        v[i, 7] * x[0] + v[i, 8] * x[1] + v[i, 9] * x[2],
    )


@_inline
def _torques(model: Model, work: Work) -> None:
    """Inverse dynamics [N·m] by the recursive Newton-Euler algorithm."""
    joints, turn, v = len(model.home), work.turn, model.inertia
    w = alpha = (0.0, 0.0, 0.0)
    a = -model.gravity[0], -model.gravity[1], -model.gravity[2]
    for i in range(joints):
        arm, axis = _row(work.shift, i), _row(model.axis, i)
        a = _turned_back(turn, i, _add(a, _add(_cross(alpha, arm), _cross(w, _cross(w, arm)))))
        w, alpha = _turned_back(turn, i, w), _turned_back(turn, i, alpha)
        rate, kick = _times(axis, work.state[1, i]), _times(axis, work.state[2, i])
        if model.prismatic[i]:
            a = _add(_add(a, kick), _times(_cross(w, rate), 2.0))
        else:
            alpha = _add(_add(alpha, kick), _cross(w, rate))
            w = _add(w, rate)
        first = v[i, 1], v[i, 2], v[i, 3]
        turning = _less(_times(w, _dot(w, first)), _times(first, _dot(w, w)))
        _keep(work.wrench, 0, i, _add(_times(a, v[i, 0]), _add(_cross(alpha, first), turning)))
        about = _add(_inertia_times(v, i, alpha), _cross(w, _inertia_times(v, i, w)))
        _keep(work.wrench, 1, i, _add(_cross(first, a), about))
    f = n = (0.0, 0.0, 0.0)
    for i in range(joints - 1, -1, -1):
        f, n = _add(f, _of(work.wrench, 0, i)), _add(n, _of(work.wrench, 1, i))
        work.torque[i] = _dot(_row(model.axis, i), f if model.prismatic[i] else n)
        f = _turned(turn, i, f)
        n = _add(_turned(turn, i, n), _cross(_row(work.shift, i), f))


@_seldom
def _torque_rates(
    model: Model, motion: np.ndarray, jerks: np.ndarray, trajectory: int, sums: np.ndarray, rate: np.ndarray
) -> None:
    """Upper bound of the absolute rate of every joint torque in a cell, (J,).

    The same recursion on norms: see ``sidegan.validity.bounds.torque_rate_bound``.
    """
    joints, g = len(rate), model.gravity
    w = dw = al = dal = da = 0.0
    a = math.sqrt(g[0] ** 2 + g[1] ** 2 + g[2] ** 2)
    for i in range(joints):
        v, acc, jerk, travel = motion[2, i], motion[3, i], jerks[trajectory, i], model.travel[i]
        a, da = a + (al + w * w) * travel, da + (dal + 2 * w * dw) * travel
        if model.prismatic[i]:
            da = da + (al + w * w) * v + jerk + 2 * (dw * v + w * acc)
            a = a + acc + 2 * w * v
        else:
            da = da + v * a
            dal = dal + v * al + jerk + (dw + v * w) * v + w * acc
            al = al + acc + w * v
            dw = dw + v * w + acc
            w = w + v
        swing, dswing, first = al + w * w, dal + 2 * w * dw, model.first[i]
        sums[0, i] = model.mass[i] * a + first * swing
        sums[1, i] = model.mass[i] * da + first * dswing
        sums[2, i] = first * a + model.spin[i] * swing
        sums[3, i] = first * da + model.spin[i] * dswing
    f = df = n = dn = 0.0
    for i in range(joints - 1, -1, -1):
        v, travel = motion[2, i], model.travel[i]
        f, df, n, dn = f + sums[0, i], df + sums[1, i], n + sums[2, i], dn + sums[3, i]
        if model.prismatic[i]:
            rate[i] = df
            dn, n = dn + travel * df + v * f, n + travel * f
        else:
            rate[i] = dn
            df, dn = df + v * f, dn + v * n
            dn, n = dn + travel * df, n + travel * f


@_inline
def _cap_rates(
    model: Model,
    work: Work,
    c: np.ndarray,
    n: int,
    basis: np.ndarray,
    rows: np.ndarray,
    jerk: np.ndarray,
    half: float,
) -> None:
    """Bounds of the torques' rates that hold in all the given cells of a trajectory.

    The bound grows with every speed and acceleration, so one for the largest of each will do.
    """
    most = work.most
    for j in range(len(model.home)):
        most[2, j] = most[3, j] = 0.0
    for row in rows:
        _roll_out(model.home, c, n, basis, row, work.state)
        _cell_motion(work.state, jerk, n, half, work.motion)
        for j in range(len(model.home)):
            most[2, j], most[3, j] = max(most[2, j], work.motion[2, j]), max(most[3, j], work.motion[3, j])
    _torque_rates(model, most, jerk, n, work.sums, work.cap)


@_inline
def _within(x: float) -> float:
    return min(max(x, 0.0), 1.0)


@_inline
def _segment_distance(a1: Vector, b1: Vector, a2: Vector, b2: Vector) -> float:
    """Distance [m] between two segments. Source: Ericson 2005, section 5.1.9."""
    u, v, r = _less(b1, a1), _less(b2, a2), _less(a1, a2)
    uu, vv, uv, ur, vr = _dot(u, u), _dot(v, v), _dot(u, v), _dot(u, r), _dot(v, r)
    determinant = uu * vv - uv * uv
    s = 0.0
    if determinant > _PARALLEL * uu * vv:
        s = _within((uv * vr - ur * vv) / max(determinant, _TINY))
    t = _within((uv * s + vr) / max(vv, _TINY))
    s = _within((uv * t - ur) / max(uu, _TINY))
    gap = _less(_between(a1, b1, s), _between(a2, b2, t))
    distance = math.sqrt(_dot(gap, gap))
    return _TOUCHING if distance < _TOUCHING else distance


@_inline
def _to_plane(numbers: np.ndarray, r: int, a: Vector, b: Vector) -> float:
    """Signed distance [m] of a segment to a half space."""
    normal = _row(numbers, r)
    return min(_dot(normal, a), _dot(normal, b)) - numbers[r, 3]


@_inline
def _point_to_box(x: Vector, half: Vector) -> float:
    """Signed distance [m] of a point from a box at the origin."""
    bx, by, bz = abs(x[0]) - half[0], abs(x[1]) - half[1], abs(x[2]) - half[2]
    ox, oy, oz = max(bx, 0.0), max(by, 0.0), max(bz, 0.0)
    return max(math.sqrt(ox * ox + oy * oy + oz * oz), _TOUCHING) + min(max(bx, by, bz), 0.0)


@_inline
def _slope(x: Vector, half: Vector, along: Vector) -> float:
    """What has the sign of the growth of the distance from a box along a direction."""
    beyond = abs(x[0]) - half[0], abs(x[1]) - half[1], abs(x[2]) - half[2]
    farthest = max(beyond[0], beyond[1], beyond[2])
    total = 0.0
    for k in range(3):
        inside = 1.0 if beyond[k] == farthest else 0.0
        size = max(beyond[k], 0.0) if farthest > 0 else inside
        total += math.copysign(size, x[k]) * along[k]
    return total


@_inline
def _to_box(centre: Vector, half: Vector, a: Vector, b: Vector) -> float:
    """Signed distance [m] of a segment to a box: convex along the segment, so halving finds the least."""
    a, b = _less(a, centre), _less(b, centre)
    along = _less(b, a)
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        if _slope(_add(a, _times(along, middle)), half, along) < 0:
            low = middle
        else:
            high = middle
    return min(_point_to_box(_between(a, b, low), half), _point_to_box(_between(a, b, high), half))


@_inline
def _reached(reach: np.ndarray, i: int, motion: np.ndarray) -> float:
    """How far the position changes in a cell move something [m], by its reach[i]."""
    total = 0.0
    for j in range(motion.shape[1]):
        total += reach[i, j] * motion[0, j]
    return total


@_inline
def _settle(
    margin: float, slack: float, last: bool, n: int, column: int, item: int, time: float, smallest: Smallest
) -> bool:
    """Take a margin into account; tells whether the cell is undecided because of it."""
    unsure = not margin >= slack
    if last and unsure and margin >= 0:
        margin -= slack
    if margin < smallest.margin[n, column] or margin != margin:
        smallest.margin[n, column] = margin
        smallest.element[n, column], smallest.time[n, column] = item, time
    return unsure


@_inline
def _check_limits(model: Model, work: Work, last: bool, n: int, time: float, smallest: Smallest) -> bool:
    """Take positions and velocities into account; tells whether one of them leaves the cell undecided."""
    state, motion, best = work.state, work.motion, smallest.margin
    undecided = False
    for j in range(len(model.home)):
        margin = state[0, j] - model.lower[j]
        if not margin <= model.upper[j] - state[0, j]:
            margin = model.upper[j] - state[0, j]
        if not margin >= max(best[n, POSITION], motion[0, j]):
            undecided |= _settle(margin, motion[0, j], last, n, POSITION, j, time, smallest)
        margin = model.speed[j] - abs(state[1, j])
        if not margin >= max(best[n, VELOCITY], motion[1, j]):
            undecided |= _settle(margin, motion[1, j], last, n, VELOCITY, j, time, smallest)
    return undecided


@_inline
def _check_torques(
    model: Model,
    work: Work,
    jerk: np.ndarray,
    half: float,
    last: bool,
    n: int,
    time: float,
    smallest: Smallest,
) -> bool:
    """The same for torques: the bound of their rates is taken in the cell only where the cap is too much."""
    _torques(model, work)
    near = False
    for j in range(len(model.home)):
        margin = model.torque[j] - abs(work.torque[j])
        near |= not margin >= max(smallest.margin[n, TORQUE], half * work.cap[j])
    if not near:
        return False
    _torque_rates(model, work.motion, jerk, n, work.sums, work.rate)
    undecided = False
    for j in range(len(model.home)):
        margin = model.torque[j] - abs(work.torque[j])
        undecided |= _settle(margin, half * work.rate[j], last, n, TORQUE, j, time, smallest)
    return undecided


@_inline
def _place_capsules(model: Model, work: Work) -> None:
    """World end points of each capsule's axis and the middle between them."""
    for k in range(len(model.link)):
        frame = model.link[k]
        base = _row(work.place, frame)
        a = _add(base, _turned(work.world, frame, _row(model.a, k)))
        b = _add(base, _turned(work.world, frame, _row(model.b, k)))
        _keep(work.ends, 0, k, a)
        _keep(work.ends, 1, k, b)
        _keep(work.ends, 2, k, _times(_add(a, b), 0.5))


@_inline
def _check_pairs(model: Model, work: Work, last: bool, n: int, time: float, smallest: Smallest) -> bool:
    """The same for pairs of capsules: only those whose balls are near enough to matter."""
    ends, motion = work.ends, work.motion
    most = _reached(model.pair_most, 0, motion)
    undecided = False
    for p in range(len(model.pairs)):
        i, j = model.pairs[p, 0], model.pairs[p, 1]
        need = max(smallest.margin[n, COLLISION], most)
        far = need + model.size[i] + model.size[j]
        apart = _less(_of(ends, 2, i), _of(ends, 2, j))
        if _dot(apart, apart) >= far * far:
            continue
        distance = _segment_distance(_of(ends, 0, i), _of(ends, 1, i), _of(ends, 0, j), _of(ends, 1, j))
        margin = distance - (model.radius[i] + model.radius[j])
        if not margin >= need:
            slack = _reached(model.pair_reach, p, motion)
            undecided |= _settle(margin, slack, last, n, COLLISION, p, time, smallest)
    return undecided


@_inline
def _check_regions(model: Model, work: Work, last: bool, n: int, time: float, smallest: Smallest) -> bool:
    """The same for capsules and keep-out regions."""
    ends, motion, numbers = work.ends, work.motion, model.regions
    most = _reached(model.region_most, 0, motion)
    undecided = False
    for g in range(len(model.guarded)):
        r, k = model.guarded[g, 0], model.guarded[g, 1]
        need = max(smallest.margin[n, KEEP_OUT], most)
        if model.kinds[r] == PLANE:
            distance = _to_plane(numbers, r, _of(ends, 0, k), _of(ends, 1, k))
        else:
            centre, half = _row(numbers, r), (numbers[r, 3], numbers[r, 4], numbers[r, 5])
            if _point_to_box(_less(_of(ends, 2, k), centre), half) >= need + model.size[k]:
                continue
            distance = _to_box(centre, half, _of(ends, 0, k), _of(ends, 1, k))
        margin = distance - model.radius[k]
        if not margin >= need:
            slack = _reached(model.region_reach, g, motion)
            undecided |= _settle(margin, slack, last, n, KEEP_OUT, g, time, smallest)
    return undecided


@_seldom
def visit(
    model: Model,
    work: Work,
    c: np.ndarray,
    jerk: np.ndarray,
    basis: np.ndarray,
    times: np.ndarray,
    which: np.ndarray,
    rows: np.ndarray,
    half: float,
    last: bool,
    smallest: Smallest,
    undecided: np.ndarray,
) -> None:
    """Update the smallest margins of trajectories, and tell which cells are undecided.

    Args:
        model: the arm in its workspace.
        work: of this thread alone.
        c: coefficients, (B, J, K).
        jerk: bound of the absolute jerk, (B, J).
        basis: derivatives 0 to 2 of the basis at the centres of cells, (T, 3, K).
        times: the same centres [s], (T,).
        which: trajectory of each cell, (N,) int; equal ones follow each other.
        rows: centre of each cell, (N,) int.
        half: half width of the cells [s].
        last: whether what is undecided counts with its guaranteed margin.
        smallest: smallest margins so far, updated in place.
        undecided: written, (N,) bool.
    """
    limited = False
    for j in range(len(model.home)):
        limited |= model.torque[j] < np.inf
    shapes = len(model.pairs) + len(model.guarded) > 0
    stop = 0
    while stop < len(which):
        start, n = stop, which[stop]
        while stop < len(which) and which[stop] == n:
            stop += 1
        if limited:
            _cap_rates(model, work, c, n, basis, rows[start:stop], jerk, half)
        for cell in range(start, stop):
            time = times[rows[cell]]
            _roll_out(model.home, c, n, basis, rows[cell], work.state)
            _cell_motion(work.state, jerk, n, half, work.motion)
            unsure = _check_limits(model, work, last, n, time, smallest)
            _place_joints(model, work)
            if limited:
                unsure |= _check_torques(model, work, jerk, half, last, n, time, smallest)
            if shapes:
                _place_capsules(model, work)
                unsure |= _check_pairs(model, work, last, n, time, smallest)
                unsure |= _check_regions(model, work, last, n, time, smallest)
            undecided[cell] = unsure
