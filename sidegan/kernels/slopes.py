"""Compiled slopes of torques, and of what their limits cost: inverse dynamics in reverse.

For cotangents s of the torques, sᵀ τ is the sum over links of wrench · twist, where the twists are those of
an arm that moves with joint speeds s. So the adjoint of a twist is the force that the recursion carries.
"""

import math

from sidegan.kernels.chain import Array, Chain
from sidegan.kernels.formulas import (
    Ten,
    add,
    cross,
    dot,
    inertia_times,
    less,
    times,
    to_child,
    to_parent,
)
from sidegan.kernels.jit import inline, kernel, kernel_in_any_order
from sidegan.kernels.lanes import (
    DDQ,
    DQ,
    LANES,
    SA,
    SALPHA,
    SDDQ,
    SDQ,
    SHIFT,
    SQ,
    SW,
    A,
    Block,
    Lanes,
    Room,
    clear,
    increase,
    load,
    load_motion,
    load_turn,
    load_wrench,
    store,
)
from sidegan.kernels.limits import Limits
from sidegan.kernels.links import Joint, joint, ten


@kernel
def _twist(j: Joint, link: Lanes, s: Lanes, twist: Lanes, wrench: Lanes, adjoint: Lanes, width: int) -> None:
    """The twist of a link of an arm that moves with speeds s, in place of its parent's; adds to q's slope."""
    axis, slide, slides, turns = j.axis, j.slide, j.slides, 1.0 - j.slides
    for n in range(min(width, LANES)):
        r, turn = load_turn(link, n), load(twist, 0, n)
        linear = to_child(r, add(load(twist, 3, n), cross(turn, load(link, SHIFT, n))))
        moved = to_child(r, cross(turn, slide))
        turn = to_child(r, turn)
        f, m = load_wrench(wrench, n)
        twisted = add(cross(f, linear), cross(m, turn))
        adjoint[SQ * LANES + n] += turns * dot(axis, twisted) + slides * dot(f, moved)
        store(twist, 0, n, add(turn, times(turns * s[n], axis)))
        store(twist, 3, n, add(linear, times(slides * s[n], axis)))


@kernel
def _slope_of_wrench(link: Lanes, v: Ten, twist: Lanes, adjoint: Lanes, width: int) -> None:
    """Add the slopes of wrench · twist in the link's motion."""
    mass, h = v[0], (v[1], v[2], v[3])
    for n in range(min(width, LANES)):
        w, (t, u) = load_motion(link, n)[0], load_wrench(twist, n)
        sa = add(times(mass, u), cross(t, h))
        salpha = add(cross(h, u), inertia_times(v, t))
        whirl = add(times(dot(w, h), u), times(dot(u, w), h))
        whirl = less(whirl, times(2.0 * dot(u, h), w))
        sw = add(cross(inertia_times(v, w), t), inertia_times(v, cross(t, w)))
        increase(adjoint, SA, n, sa)
        increase(adjoint, SALPHA, n, salpha)
        increase(adjoint, SW, n, add(whirl, sw))


@kernel
def _unmove(
    j: Joint, state: Lanes, parent: Lanes, link: Lanes, above: Lanes, adjoint: Lanes, width: int
) -> None:
    """Carry the adjoints of a link's motion to its parent's, and write those of the joint's state."""
    axis, slides, turns = j.axis, j.slides, 1.0 - j.slides
    for n in range(min(width, LANES)):
        r, shift = load_turn(link, n), load(link, SHIFT, n)
        w0, alpha0, _ = load_motion(parent, n)
        sw, salpha, sa = load(adjoint, SW, n), load(adjoint, SALPHA, n), load(adjoint, SA, n)
        rate, kick = times(state[DQ * LANES + n], axis), times(state[DDQ * LANES + n], axis)
        # w, alpha and a as they were after the rotation and before the joint's own motion.
        w = to_child(r, w0)
        alpha = to_child(r, alpha0)
        turning = cross(w, rate)
        a = less(load(link, A, n), times(slides, add(kick, times(2.0, turning))))
        # The joint's own motion.
        sturning = add(times(turns, salpha), times(2.0 * slides, sa))
        skick = add(times(turns, salpha), times(slides, sa))
        srate = add(times(turns, sw), cross(sturning, w))
        sw = add(sw, cross(rate, sturning))
        adjoint[SDQ * LANES + n] += dot(axis, srate)
        adjoint[SDDQ * LANES + n] += dot(axis, skick)
        # The rotation.
        turned = add(cross(sw, w), add(cross(salpha, alpha), cross(sa, a)))
        slope = turns * dot(axis, turned)
        sw, salpha, sa = to_parent(r, sw), to_parent(r, salpha), to_parent(r, sa)
        # The way from the parent's origin to the link's.
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
def push(chain: Chain, v: Array, work: Room, width: int) -> None:
    """Add the slopes of sᵀ τ to the adjoints, where s stands in place of the torques τ."""
    clear(work.twist)
    for i in range(len(chain.prismatic)):
        link, adjoint = work.links[i + 1], work.adjoints[i + 1]
        _twist(joint(chain, i), link, work.torque[i], work.twist, work.wrenches[i], adjoint, width)
        _slope_of_wrench(link, ten(v, 10 * i), work.twist, adjoint, width)


@kernel
def pull(chain: Chain, work: Room, slope: Array, block: Block, width: int) -> None:
    """Carry the adjoints down to the base; write the slopes of a block in q, dq and ddq."""
    links, adjoints = work.links, work.adjoints
    b, start, lanes = block
    for i in range(len(chain.prismatic) - 1, -1, -1):
        adjoint = adjoints[i + 1]
        _unmove(joint(chain, i), work.state[i], links[i], links[i + 1], adjoints[i], adjoint, width)
        for r in range(3):
            for n in range(min(lanes, LANES)):
                slope[r, b, i, start + n] = adjoint[(SQ + r) * LANES + n]


@inline
def beyond(x: float, limit: float, reserve: float) -> float:
    """How far |x| exceeds the limit less the reserve, as a share of the limit and with x's sign; or zero."""
    return math.copysign(max(abs(x) / limit - (1.0 - reserve), 0.0), x)


@kernel_in_any_order
def keep(limits: Limits, work: Room, lanes: int) -> float:
    """What the torques of a block cost; puts its slopes in them in their place."""
    total = 0.0
    for i in range(len(limits.torque)):
        torque, most = work.torque[i], limits.torque[i]
        for n in range(min(lanes, LANES)):
            tau = beyond(torque[n], most, limits.torque_reserve)
            torque[n] = 2.0 * limits.torque_weight / most * tau
            total += tau * tau
    return limits.torque_weight * total
