"""Compiled inverse dynamics and its gradient, for a block of states at a time.

A lane is one state. The lanes of a quantity are contiguous in memory, so the compiler vectorises loops over
them, and the data of a block fits in the processor's cache. These loops end at min(width, LANES) because the
constant lets the compiler drop the test for negative indices.

The states of B trajectories are (5, B, J, T): sine and cosine of the position, position, velocity,
acceleration.

Gradients come from reverse-mode differentiation. For cotangents s of the torques, sᵀ τ is the sum over links
of wrench · twist, with the twists of an arm that moves at joint speeds s. The adjoint of a twist is therefore
the wrench that the recursion carries.
"""

import math
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array
from sidegan.kernels.chain import Chain
from sidegan.kernels.formulas import (
    LinkMotion,
    Matrix,
    Ten,
    Vector,
    Wrench,
    add,
    cross,
    dot,
    inertia_times,
    less,
    link_motion,
    scale,
    to_child,
    to_parent,
    wrench_in_parent,
    wrench_of,
)
from sidegan.kernels.jit import inline, kernel, kernel_in_any_order
from sidegan.kernels.links import ChainJoint, joint, placement, ten

LANES = 64  # maximum states per block: shorter loops do not amortise their overhead
_VECTOR = 8  # float64 numbers in the widest vector register

# Rows of a link's block: rotation, origin, angular velocity and acceleration, linear acceleration.
TURN, SHIFT, W, ALPHA, A, _LINK = 0, 9, 12, 15, 18, 21
# Rows of a joint's state: sine and cosine of the position, position, velocity, acceleration.
SIN, COS, Q, DQ, DDQ, _STATE = 0, 1, 2, 3, 4, 5
# Rows of a link's adjoints: w, alpha and a of its motion; q, dq and ddq of its joint.
SW, SALPHA, SA, SQ, SDQ, SDDQ, _ADJOINT = 0, 3, 6, 9, 10, 11, 12

Lanes = Array  # contiguous rows of LANES numbers, (rows · LANES,)
Block = tuple[int, int, int]  # consecutive states: index of the trajectory, first state, number of states


class PenaltyLimits(NamedTuple):
    """Limits of J joints, and the penalty for exceeding them.

    The penalty is weight · e², with e the excess of |x| over (1 − reserve) · limit, relative to the limit.
    """

    weight: float  # for positions, velocities and higher derivatives
    reserve: float  # fraction of their limits to keep free
    torque_weight: float
    torque_reserve: float
    middle: Array  # midpoint of the position range [rad or m], (J,)
    room: Array  # half width of the position range [rad or m], (J,)
    speed: Array  # velocity limit [rad/s or m/s], (J,)
    torque: Array  # torque limit minus dry friction [N·m or N], (J,); infinite where unlimited
    parameters: Array  # inertial parameters for the torques, (10 J,)
    viscous: Array  # viscous friction coefficient [N·m·s/rad or N·s/m], (J,)
    rotor: Array  # rotor inertia on the joint side [kg·m² or kg], (J,)


class DynamicsBuffers(NamedTuple):
    """Scratch arrays of one thread: rows of lanes for each joint or link."""

    state: Array
    links: Array
    screws: Array
    ten: Array
    wrenches: Array
    torque: Array
    twist: Array
    adjoints: Array


def dynamics_buffers(chain: Chain) -> DynamicsBuffers:
    """Scratch arrays of one thread for an arm; its base is at rest and accelerates against gravity."""
    joints, links = len(chain.prismatic), len(chain.prismatic) + 1
    rows = [(joints, _STATE), (links, _LINK), (joints, 6), (10,), (joints, 6), (joints, 1), (6,)]
    work = DynamicsBuffers(*(aligned(*shape[:-1], shape[-1] * LANES) for shape in [*rows, (links, _ADJOINT)]))
    work.links[0].reshape(_LINK, LANES)[A:] = -chain.gravity[:, None]
    return work


def aligned(*shape: int) -> Array:
    """Zeros aligned to a cache line: loading a vector that straddles two lines takes twice as long."""
    size = math.prod(shape)
    room = np.zeros(size + _VECTOR)
    skipped = -room.ctypes.data % (8 * _VECTOR) // 8
    return room[skipped : skipped + size].reshape(shape)


@inline
def load(x: Lanes, row: int, n: int) -> Vector:
    """Read lane n of three consecutive rows."""
    return x[row * LANES + n], x[(row + 1) * LANES + n], x[(row + 2) * LANES + n]


@inline
def store(x: Lanes, row: int, n: int, v: Vector) -> None:
    """Write lane n of three consecutive rows."""
    x[row * LANES + n] = v[0]
    x[(row + 1) * LANES + n] = v[1]
    x[(row + 2) * LANES + n] = v[2]


@inline
def increase(x: Lanes, row: int, n: int, v: Vector) -> None:
    """Add to lane n of three consecutive rows."""
    store(x, row, n, add(load(x, row, n), v))


@inline
def load_turn(link: Lanes, n: int) -> Matrix:
    """Rotation of a link in lane n."""
    return load(link, TURN, n), load(link, TURN + 3, n), load(link, TURN + 6, n)


@inline
def load_motion(link: Lanes, n: int) -> LinkMotion:
    """Motion of a link in lane n."""
    return load(link, W, n), load(link, ALPHA, n), load(link, A, n)


@inline
def load_wrench(x: Lanes, n: int) -> Wrench:
    """Force and moment from lane n of six rows."""
    return load(x, 0, n), load(x, 3, n)


@inline
def step_of(count: int) -> int:
    """Lanes per block for ``count`` states: blocks of nearly equal size, in whole vectors."""
    count = max(1, count)
    blocks = (count + LANES - 1) // LANES
    return ((count + blocks - 1) // blocks + _VECTOR - 1) // _VECTOR * _VECTOR


@kernel
def fill(states: Array, block: Block, width: int, state: Array) -> None:
    """Copy a block of states into lanes; pad the remaining lanes with its last state."""
    b, first, count = block
    for j in range(states.shape[2]):
        for r in range(_STATE):
            for n in range(count):
                state[j, r * LANES + n] = states[r, b, j, first + n]
            for n in range(count, width):
                state[j, r * LANES + n] = states[r, b, j, first + count - 1]


@kernel
def move(j: ChainJoint, state: Lanes, parent: Lanes, link: Lanes, width: int) -> None:
    """Write a link's placement and motion, from its joint's state and its parent's motion."""
    for n in range(min(width, LANES)):
        s, c, q = state[SIN * LANES + n], state[COS * LANES + n], state[Q * LANES + n]
        r, shift = placement(j, s, c, q)
        rates = state[DQ * LANES + n], state[DDQ * LANES + n]
        w, alpha, a = link_motion(j.axis, j.slides, r, shift, rates, load_motion(parent, n))
        store(link, TURN, n, r[0])
        store(link, TURN + 3, n, r[1])
        store(link, TURN + 6, n, r[2])
        store(link, SHIFT, n, shift)
        store(link, W, n, w)
        store(link, ALPHA, n, alpha)
        store(link, A, n, a)


@kernel
def _wrench(link: Lanes, v: Ten, wrench: Lanes, width: int) -> None:
    """Write the force and the moment about the link's origin that its motion requires."""
    for n in range(min(width, LANES)):
        force, moment = wrench_of(v, load_motion(link, n))
        store(wrench, 0, n, force)
        store(wrench, 3, n, moment)


@kernel
def _pass_down(child: Lanes, child_wrench: Lanes, wrench: Lanes, width: int) -> None:
    """Add the wrench of a child link to that of its parent."""
    for n in range(min(width, LANES)):
        f, m = wrench_in_parent(load_turn(child, n), load(child, SHIFT, n), load_wrench(child_wrench, n))
        increase(wrench, 0, n, f)
        increase(wrench, 3, n, m)


@kernel
def _along(axis: Vector, slides: bool, wrench: Lanes, torque: Lanes, width: int) -> None:
    """Write the component of a wrench along the joint's axis: its torque, or force if prismatic."""
    for n in range(min(width, LANES)):
        torque[n] = dot(axis, load(wrench, 0, n) if slides else load(wrench, 3, n))


@kernel
def clear(x: Lanes) -> None:
    """Set to zero."""
    for n in range(len(x)):  # several times faster than x[:] = 0
        x[n] = 0.0


@kernel
def enter(chain: Chain, states: Array, block: Block, width: int, work: DynamicsBuffers) -> None:
    """Compute the motion of all links in a block of states, and reset the adjoints."""
    fill(states, block, width, work.state)
    for i in range(len(chain.prismatic)):
        move(joint(chain, i), work.state[i], work.links[i], work.links[i + 1], width)
    for link in range(len(work.adjoints)):
        clear(work.adjoints[link])


@kernel
def forces(chain: Chain, v: Array, work: DynamicsBuffers, width: int) -> None:
    """Compute the joint wrenches and torques for one parameter set, (10 J,)."""
    joints, links, wrenches = len(chain.prismatic), work.links, work.wrenches
    for i in range(joints):
        _wrench(links[i + 1], ten(v, 10 * i), wrenches[i], width)
    for i in range(joints - 1, -1, -1):
        if i + 1 < joints:
            _pass_down(links[i + 2], wrenches[i + 1], wrenches[i], width)
        _along(joint(chain, i).axis, chain.prismatic[i], wrenches[i], work.torque[i], width)


@kernel
def inverse_dynamics(
    chain: Chain, states: Array, parameters: Array, torque: Array, work: DynamicsBuffers
) -> None:
    """Write the torques (J, T) for states (5, 1, J, T) and inertial parameters (10 J,)."""
    count = states.shape[3]
    step = step_of(count)
    for start in range(0, count, step):
        lanes = min(step, count - start)
        enter(chain, states, (0, start, lanes), step, work)
        forces(chain, parameters, work, step)
        for j in range(len(torque)):
            for n in range(min(lanes, LANES)):
                torque[j, start + n] = work.torque[j, n]


@kernel
def _twist(
    j: ChainJoint, link: Lanes, s: Lanes, twist: Lanes, wrench: Lanes, adjoint: Lanes, width: int
) -> None:
    """Replace the parent's twist, at joint speeds s, by the link's; add to the adjoint of q."""
    axis, slide, slides, turns = j.axis, j.slide, j.slides, 1.0 - j.slides
    for n in range(min(width, LANES)):
        r, turn = load_turn(link, n), load(twist, 0, n)
        linear = to_child(r, add(load(twist, 3, n), cross(turn, load(link, SHIFT, n))))
        moved = to_child(r, cross(turn, slide))
        turn = to_child(r, turn)
        f, m = load_wrench(wrench, n)
        twisted = add(cross(f, linear), cross(m, turn))
        adjoint[SQ * LANES + n] += turns * dot(axis, twisted) + slides * dot(f, moved)
        store(twist, 0, n, add(turn, scale(turns * s[n], axis)))
        store(twist, 3, n, add(linear, scale(slides * s[n], axis)))


@kernel
def _slope_of_wrench(link: Lanes, v: Ten, twist: Lanes, adjoint: Lanes, width: int) -> None:
    """Add the gradient of wrench · twist with respect to the link's motion."""
    mass, h = v[0], (v[1], v[2], v[3])
    for n in range(min(width, LANES)):
        w, (t, u) = load_motion(link, n)[0], load_wrench(twist, n)
        sa = add(scale(mass, u), cross(t, h))
        salpha = add(cross(h, u), inertia_times(v, t))
        whirl = add(scale(dot(w, h), u), scale(dot(u, w), h))
        whirl = less(whirl, scale(2.0 * dot(u, h), w))
        sw = add(cross(inertia_times(v, w), t), inertia_times(v, cross(t, w)))
        increase(adjoint, SA, n, sa)
        increase(adjoint, SALPHA, n, salpha)
        increase(adjoint, SW, n, add(whirl, sw))


@kernel
def _unmove(
    j: ChainJoint, state: Lanes, parent: Lanes, link: Lanes, above: Lanes, adjoint: Lanes, width: int
) -> None:
    """Propagate the adjoints of a link's motion to its parent; add to those of the joint's state."""
    axis, slides, turns = j.axis, j.slides, 1.0 - j.slides
    for n in range(min(width, LANES)):
        r, shift = load_turn(link, n), load(link, SHIFT, n)
        w0, alpha0, _ = load_motion(parent, n)
        sw, salpha, sa = load(adjoint, SW, n), load(adjoint, SALPHA, n), load(adjoint, SA, n)
        rate, kick = scale(state[DQ * LANES + n], axis), scale(state[DDQ * LANES + n], axis)
        # Recover w, alpha and a after the rotation but before the joint's own motion was added.
        w = to_child(r, w0)
        alpha = to_child(r, alpha0)
        turning = cross(w, rate)
        a = less(load(link, A, n), scale(slides, add(kick, scale(2.0, turning))))
        # The joint's own motion.
        sturning = add(scale(turns, salpha), scale(2.0 * slides, sa))
        skick = add(scale(turns, salpha), scale(slides, sa))
        srate = add(scale(turns, sw), cross(sturning, w))
        sw = add(sw, cross(rate, sturning))
        adjoint[SDQ * LANES + n] += dot(axis, srate)
        adjoint[SDDQ * LANES + n] += dot(axis, skick)
        # The rotation.
        turned = add(cross(sw, w), add(cross(salpha, alpha), cross(sa, a)))
        slope = turns * dot(axis, turned)
        sw, salpha, sa = to_parent(r, sw), to_parent(r, salpha), to_parent(r, sa)
        # The offset from the parent's origin to the link's.
        swirl = cross(w0, shift)
        sshift = add(cross(sa, alpha0), cross(cross(sa, w0), w0))
        slope += slides * dot(j.slide, sshift)
        salpha = add(salpha, cross(shift, sa))
        sw = add(sw, add(cross(swirl, sa), cross(shift, cross(sa, w0))))
        adjoint[SQ * LANES + n] += slope
        increase(above, SW, n, sw)
        increase(above, SALPHA, n, salpha)
        increase(above, SA, n, sa)


@kernel
def push(chain: Chain, v: Array, work: DynamicsBuffers, width: int) -> None:
    """Add the gradient of sᵀ τ to the adjoints; ``work.torque`` holds the cotangents s, not τ."""
    clear(work.twist)
    for i in range(len(chain.prismatic)):
        link, adjoint = work.links[i + 1], work.adjoints[i + 1]
        _twist(joint(chain, i), link, work.torque[i], work.twist, work.wrenches[i], adjoint, width)
        _slope_of_wrench(link, ten(v, 10 * i), work.twist, adjoint, width)


@kernel
def pull(chain: Chain, work: DynamicsBuffers, slope: Array, block: Block, width: int) -> None:
    """Propagate the adjoints to the base; write a block's gradient with respect to q, dq and ddq."""
    links, adjoints = work.links, work.adjoints
    _, start, lanes = block
    for i in range(len(chain.prismatic) - 1, -1, -1):
        adjoint = adjoints[i + 1]
        _unmove(joint(chain, i), work.state[i], links[i], links[i + 1], adjoints[i], adjoint, width)
        for r in range(3):
            for n in range(min(lanes, LANES)):
                slope[r, i, start + n] = adjoint[(SQ + r) * LANES + n]


@inline
def limit_excess(x: float, limit: float, reserve: float) -> float:
    """Excess of |x| over (1 − reserve) · limit, relative to the limit and with the sign of x, or zero."""
    return math.copysign(max(abs(x) / limit - (1.0 - reserve), 0.0), x)


@kernel_in_any_order
def keep(limits: PenaltyLimits, work: DynamicsBuffers, lanes: int) -> float:
    """Torque penalty of a block; replaces the torques by its gradient, adds to the adjoints of dq and ddq."""
    total = 0.0
    for i in range(len(limits.torque)):
        torque, most, viscous, rotor = work.torque[i], limits.torque[i], limits.viscous[i], limits.rotor[i]
        state, adjoint = work.state[i], work.adjoints[i + 1]
        for n in range(min(lanes, LANES)):
            own = viscous * state[DQ * LANES + n] + rotor * state[DDQ * LANES + n]
            tau = limit_excess(torque[n] + own, most, limits.torque_reserve)
            slope = 2.0 * limits.torque_weight / most * tau
            torque[n] = slope
            adjoint[SDQ * LANES + n] += viscous * slope
            adjoint[SDDQ * LANES + n] += rotor * slope
            total += tau * tau
    return limits.torque_weight * total
