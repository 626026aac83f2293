"""Compiled products of the base regressor with itself, without ever storing all of it."""

from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array
from sidegan.kernels.chain import Chain
from sidegan.kernels.dynamics import (
    LANES,
    SHIFT,
    Block,
    DynamicsBuffers,
    Lanes,
    fill,
    load,
    load_motion,
    load_turn,
    move,
    step_of,
    store,
)
from sidegan.kernels.formulas import add, cross, regressor_entries, scale, to_child
from sidegan.kernels.jit import inline_in_any_order, kernel, kernel_in_any_order
from sidegan.kernels.links import ChainJoint, joint

SPAN = 2 * LANES  # maximum states per block of the regressor, which must fit in the cache

Four = tuple[float, float, float, float]


class Columns(NamedTuple):
    """The p base columns, ordered by link."""

    kinds: Array  # index of each column among its link's ten parameters, (p,)
    first: Array  # first column of each link, and p at the end, (J + 1,)


def columns_of_links(columns: Array, joints: int) -> Columns:
    """Ascending columns of the full regressor, for kernels."""
    return Columns(columns % 10, np.searchsorted(columns // 10, np.arange(joints + 1)))


@kernel
def _carry_screw(link: Lanes, screw: Lanes, width: int) -> None:
    """Transform a joint's screw from the parent's frame to the link's."""
    for n in range(min(width, LANES)):
        r, turn = load_turn(link, n), load(screw, 0, n)
        linear = add(load(screw, 3, n), cross(turn, load(link, SHIFT, n)))
        store(screw, 0, n, to_child(r, turn))
        store(screw, 3, n, to_child(r, linear))


@kernel
def _new_screw(j: ChainJoint, screw: Lanes, width: int) -> None:
    for n in range(min(width, LANES)):
        store(screw, 0, n, scale(1.0 - j.slides, j.axis))
        store(screw, 3, n, scale(j.slides, j.axis))


@kernel
def _columns(link: Lanes, screw: Lanes, ten: Lanes, width: int) -> None:
    """Write a link's ten regressor entries in one joint's row."""
    for n in range(min(width, LANES)):
        x = regressor_entries(load_motion(link, n), load(screw, 0, n), load(screw, 3, n))
        ten[n] = x[0]
        store(ten, 1, n, (x[1], x[2], x[3]))
        store(ten, 4, n, (x[4], x[5], x[6]))
        store(ten, 7, n, (x[7], x[8], x[9]))


@kernel
def base_rows(
    chain: Chain, states: Array, block: Block, columns: Columns, work: DynamicsBuffers, y: Array
) -> int:
    """Write the base regressor of a block of states; returns the number of lanes per joint.

    Row k of y holds column k for joint 0's lanes, then joint 1's, … up to the joint of its own link; joints
    further out do not feel it. Unused lanes are zero. y needs the size (p, J · (count + LANES)).
    """
    b, start, count = block
    state, links, screws, ten = work.state, work.links, work.screws, work.ten
    step = step_of(count)
    span = (count + step - 1) // step * step
    for at in range(0, count, step):
        lanes = min(step, count - at)
        fill(states, (b, start + at, lanes), step, state)
        for i in range(states.shape[2]):
            link = links[i + 1]
            move(joint(chain, i), state[i], links[i], link, step)
            _new_screw(joint(chain, i), screws[i], step)
            for j in range(i + 1):
                screw = screws[j]
                if j < i:
                    _carry_screw(link, screw, step)
                _columns(link, screw, ten, step)
                for k in range(columns.first[i], columns.first[i + 1]):
                    row, to, kind = y[k], j * span + at, columns.kinds[k] * LANES
                    for n in range(min(lanes, LANES)):
                        row[to + n] = ten[kind + n]
                    for n in range(lanes, step):
                        row[to + n] = 0.0
    return span


@inline_in_any_order
def _four(s: Four, x: float, y: Four) -> Four:
    return s[0] + x * y[0], s[1] + x * y[1], s[2] + x * y[2], s[3] + x * y[3]


@kernel_in_any_order
def tile(y: Array, p: tuple[int, int], q: tuple[int, int], low: int, high: int, out: Array) -> None:
    """Add scalar products of up to four rows p = (first, end) with four rows q, over ``low`` to ``high``."""
    (i, ps), (j, qs) = p, q
    a0, a1, a2, a3 = y[i], y[min(i + 1, ps - 1)], y[min(i + 2, ps - 1)], y[min(i + 3, ps - 1)]
    b0, b1, b2, b3 = y[j], y[min(j + 1, qs - 1)], y[min(j + 2, qs - 1)], y[min(j + 3, qs - 1)]
    s0 = s1 = s2 = s3 = (0.0, 0.0, 0.0, 0.0)
    for n in range(low, high):
        b = b0[n], b1[n], b2[n], b3[n]
        s0, s1 = _four(s0, a0[n], b), _four(s1, a1[n], b)
        s2, s3 = _four(s2, a2[n], b), _four(s3, a3[n], b)
    products = s0, s1, s2, s3
    for k in range(min(4, ps - i)):
        for m in range(min(4, qs - j)):
            out[i + k, j + m] += products[k][m]


@kernel
def mirror(x: Array, factor: float) -> None:
    """Scale the upper triangle, with the diagonal, and copy it to the lower one."""
    for p in range(len(x)):
        for q in range(p, len(x)):
            x[p, q] *= factor
            x[q, p] = x[p, q]


@kernel
def base_products(
    chain: Chain,
    states: Array,
    torque: Array,
    columns: Columns,
    products: Array,
    work: DynamicsBuffers,
    y: Array,
) -> None:
    """Write each joint's sums of products of base columns and torque, (J, p + 1, p + 1), initially zero.

    The states are (5, 1, J, T); the torque, (J, T), is the last column. y is scratch for both,
    (p + 1, J · SPAN).
    """
    joints, count, size = states.shape[2], states.shape[3], len(columns.kinds)
    for start in range(0, count, SPAN):
        lanes = min(SPAN, count - start)
        span = base_rows(chain, states, (0, start, lanes), columns, work, y)
        for j in range(joints):
            for n in range(span):
                y[size, j * span + n] = torque[j, start + n] if n < lanes else 0.0
        for j in range(joints):
            for p in range(columns.first[j], size + 1, 4):
                for q in range(p, size + 1, 4):
                    tile(y, (p, size + 1), (q, size + 1), j * span, (j + 1) * span, products[j])
    for j in range(joints):
        mirror(products[j], 1.0)
