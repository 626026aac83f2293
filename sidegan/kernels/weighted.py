"""Compiled information of one trajectory whose joints count by weights, and the slopes of functions of it."""

from sidegan.kernels.chain import Array, Chain
from sidegan.kernels.jit import kernel
from sidegan.kernels.lanes import LANES, Room, clear, enter, forces, rest, step_of
from sidegan.kernels.limits import Limits
from sidegan.kernels.regressor import SPAN, Columns, mirror, rows_of, tile
from sidegan.kernels.slopes import keep, pull, push
from sidegan.kernels.terms import (
    JointTerms,
    Signals,
    add_terms,
    add_torques,
    pull_terms,
    push_terms,
    write_signals,
)


@kernel
def _weigh(columns: Columns, roots: Array, span: int, y: Array) -> None:
    """Multiply the rows of a regressor's joints, as ``rows_of`` leaves them, by roots of their weights."""
    for i in range(len(roots)):
        for k in range(columns.first[i], columns.first[i + 1]):
            row = y[k]
            for j in range(i + 1):
                factor = roots[j]
                for n in range(j * span, (j + 1) * span):
                    row[n] *= factor


@kernel
def weighted_gram(
    chain: Chain, states: Array, columns: Columns, terms: tuple[JointTerms, Signals], roots: Array,
    gram: Array, work: Room, y: Array,
) -> None:  # fmt: skip
    """Write the Gram matrix YᵀWY / T, (P, P), of a trajectory's states (5, 1, J, T), and the terms' signals.

    The base columns come first, then the terms. The weights W are of joints; given are their roots, (J,).
    There is room in y for the regressor.
    """
    count, size, first = states.shape[3], len(columns.kinds), columns.first
    write_signals(terms[0], states, terms[1])
    for p in range(len(gram)):
        clear(gram[p])
    rest(chain.gravity, work.links[0])
    for start in range(0, count, SPAN):
        block = 0, start, min(SPAN, count - start)
        span = rows_of(chain, states, block, columns, work, y)
        _weigh(columns, roots, span, y)
        for i in range(len(roots)):
            for p in range(first[i], first[i + 1], 4):
                for q in range(p, size, 4):
                    tile(y, (p, first[i + 1]), (q, size), 0, (i + 1) * span, gram)
        add_terms(terms[0], columns, roots, terms[1], block, span, y, gram)
    mirror(gram, 1 / count)


@kernel
def weighted_slopes(
    chain: Chain,
    limits: Limits,
    states: Array,
    terms: tuple[JointTerms, Signals],
    roots: Array,
    directions: tuple[Array, Array],
    slope: Array,
    work: Room,
) -> float:
    """Write the slopes in q, dq and ddq, (3, 1, J, T), of an energy and of what torques cost; the latter.

    The energy is Σ weight · w |τ|² over parameter sets (K, 10 J), with the terms' shares in each, joints and
    time, with the weights (K,) of the sets and w of the joints. The terms' signals are those of the states.
    """
    (sets, weights), count, cost = directions, states.shape[3], 0.0
    for e in range(len(terms[1].pushes)):
        clear(terms[1].pushes[e])
    rest(chain.gravity, work.links[0])
    step = step_of(count)
    for start in range(0, count, step):
        block = 0, start, min(step, count - start)
        enter(chain, states, block, step, work)
        for k in range(len(weights)):
            if weights[k] == 0:
                continue
            forces(chain, sets[k], work, step)
            add_torques(terms[0], terms[1], k, block, work.torque)
            for j in range(len(roots)):
                torque, factor = work.torque[j], 2.0 * weights[k] * roots[j] * roots[j]
                for n in range(min(step, LANES)):
                    torque[n] *= factor
            push(chain, sets[k], work, step)
            push_terms(terms[0], terms[1], k, block, work.torque)
        if limits.torque_weight > 0:
            forces(chain, limits.parameters, work, step)
            cost += keep(limits, work, block[2])
            push(chain, limits.parameters, work, step)
        pull(chain, work, slope, block, step)
    pull_terms(terms[0], terms[1], slope)
    return cost
