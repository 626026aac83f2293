"""Compiled information of trajectories with weighted joints, and gradients of functions of it.

Besides the rigid-body dynamics, joint torques have terms: rotor inertia, friction, offset. Each is a column
of the regressor that is nonzero only in its own joint's rows. ``Terms`` of an identified model defines them.
"""

import math
from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array
from sidegan.kernels.chain import Chain
from sidegan.kernels.dynamics import (
    DDQ,
    DQ,
    LANES,
    Block,
    PenaltyLimits,
    clear,
    enter,
    forces,
    keep,
    pull,
    push,
    step_of,
)
from sidegan.kernels.dynamics import DynamicsBuffers as Buffers
from sidegan.kernels.jit import kernel
from sidegan.kernels.regressor import SPAN, Columns, base_rows, mirror, tile

TERM_KINDS = ("rotor_inertia", "viscous", "coulomb", "offset")
_ROTOR, _VISCOUS, _, _OFFSET = range(len(TERM_KINDS))


class JointTerms(NamedTuple):
    """E terms, ordered by joint, and the weights of the joints."""

    kinds: Array  # index of each term's kind in ``TERM_KINDS``, (E,)
    first: Array  # first term of each joint, and E at the end, (J + 1,)
    width: float  # velocity scale of the smooth sign tanh(dq / width) [rad/s or m/s]
    roots: Array  # square roots of the weights of the joint torques, (J,)


class Signals(NamedTuple):
    """Regressor entries of the terms, their derivatives, and scratch arrays."""

    values: Array  # entries of the regressor, (E, T)
    rates: Array  # derivatives of the values in the velocity, for rotors in the acceleration, (E, T)
    pushes: Array  # gradient of an energy in the values, (E, T)
    shares: Array  # the terms' parameters in each set, (K, E)


TermSignals = tuple[JointTerms, Signals]


def no_terms(joints: int) -> JointTerms:
    """No terms, and joints of equal weight."""
    return JointTerms(np.zeros(0, np.int64), np.zeros(joints + 1, np.int64), 1.0, np.ones(joints))


def signals_for(terms: JointTerms, samples: int, sets: int) -> Signals:
    """Signals for T samples and K parameter sets, all zero."""
    size = len(terms.kinds), samples
    return Signals(np.zeros(size), np.zeros(size), np.zeros(size), np.zeros((sets, len(terms.kinds))))


@kernel
def write_signals(terms: JointTerms, states: Array, b: int, signals: Signals) -> None:
    """Write values and their derivatives along trajectory b of states (5, B, J, T)."""
    for j in range(len(terms.first) - 1):
        for e in range(terms.first[j], terms.first[j + 1]):
            kind = terms.kinds[e]
            for n in range(states.shape[3]):
                if kind == _ROTOR:
                    value, rate = states[DDQ, b, j, n], 1.0
                elif kind == _VISCOUS:
                    value, rate = states[DQ, b, j, n], 1.0
                elif kind == _OFFSET:
                    value, rate = 1.0, 0.0
                else:
                    value = math.tanh(states[DQ, b, j, n] / terms.width)
                    rate = (1.0 - value * value) / terms.width
                signals.values[e, n], signals.rates[e, n] = value, rate


@kernel
def add_terms(
    terms: JointTerms, columns: Columns, signals: Signals, block: Block, span: int, y: Array, gram: Array
) -> None:
    """Add a block's products of the terms with one another and with the weighted rigid-body columns.

    The rigid-body columns are the first rows of y, as written by ``base_rows``; the terms' rows follow. Only
    the upper triangle is updated.
    """
    _, start, count = block
    size = len(columns.kinds)
    for j in range(len(terms.first) - 1):
        low, high = j * span, (j + 1) * span
        begin, end = size + terms.first[j], size + terms.first[j + 1]
        for e in range(terms.first[j], terms.first[j + 1]):
            row = y[size + e]
            clear(row[low:high])
            for n in range(count):
                row[low + n] = terms.roots[j] * signals.values[e, start + n]
        for q in range(begin, end, 4):
            for p in range(columns.first[j], size, 4):
                tile(y, (p, size), (q, end), low, high, gram)
        for p in range(begin, end, 4):
            for q in range(p, end, 4):
                tile(y, (p, end), (q, end), low, high, gram)


@kernel
def add_torques(terms: JointTerms, signals: Signals, k: int, block: Block, torque: Array) -> None:
    """Add the torques of the terms in set k to the rigid-body torques in lanes (J, LANES)."""
    _, start, count = block
    for j in range(len(torque)):
        for e in range(terms.first[j], terms.first[j + 1]):
            share, values = signals.shares[k, e], signals.values[e]
            for n in range(min(count, LANES)):
                torque[j, n] += share * values[start + n]


@kernel
def push_terms(terms: JointTerms, signals: Signals, k: int, block: Block, torque: Array) -> None:
    """Add the gradient in the terms' values, from torque cotangents in lanes (J, LANES)."""
    _, start, count = block
    for j in range(len(torque)):
        for e in range(terms.first[j], terms.first[j + 1]):
            share, pushes = signals.shares[k, e], signals.pushes[e]
            for n in range(min(count, LANES)):
                pushes[start + n] += share * torque[j, n]


@kernel
def pull_terms(terms: JointTerms, signals: Signals, slope: Array) -> None:
    """Add to the gradient in q, dq and ddq, (3, J, T), the part that the terms' values contribute."""
    for j in range(len(terms.first) - 1):
        for e in range(terms.first[j], terms.first[j + 1]):
            to = slope[2 if terms.kinds[e] == _ROTOR else 1, j]
            rates, pushes = signals.rates[e], signals.pushes[e]
            for n in range(len(to)):
                to[n] += rates[n] * pushes[n]


@kernel
def _weigh(columns: Columns, roots: Array, span: int, y: Array) -> None:
    """Scale each joint's rows of a regressor, as written by ``base_rows``, by the root of its weight."""
    for i in range(len(roots)):
        for k in range(columns.first[i], columns.first[i + 1]):
            row = y[k]
            for j in range(i + 1):
                factor = roots[j]
                for n in range(j * span, (j + 1) * span if factor != 1 else 0):
                    row[n] *= factor


@kernel
def weighted_grams(
    chain: Chain, states: Array, columns: Columns, extra: TermSignals, grams: Array, work: Buffers, y: Array
) -> None:
    """Write the Gram matrices YᵀWY / T, (B, P, P), of B trajectories' states (5, B, J, T).

    Base columns come first, then the terms; the signals keep those of the last trajectory. W holds the joint
    weights, and y, (P, J · SPAN), is scratch for the regressor.
    """
    (terms, signals), count = extra, states.shape[3]
    size, first, roots = len(columns.kinds), columns.first, terms.roots
    for b in range(len(grams)):
        gram = grams[b]
        write_signals(terms, states, b, signals)
        for p in range(len(gram)):
            clear(gram[p])
        for start in range(0, count, SPAN):
            block = b, start, min(SPAN, count - start)
            span = base_rows(chain, states, block, columns, work, y)
            _weigh(columns, roots, span, y)
            for i in range(len(roots)):
                for p in range(first[i], first[i + 1], 4):
                    for q in range(p, size, 4):
                        tile(y, (p, first[i + 1]), (q, size), 0, (i + 1) * span, gram)
            add_terms(terms, columns, signals, block, span, y, gram)
        mirror(gram, 1 / count)


@kernel
def weighted_slopes(
    chain: Chain,
    limits: PenaltyLimits,
    states: Array,
    extra: TermSignals,
    directions: tuple[Array, Array],
    slope: Array,
    work: Buffers,
) -> float:
    """Torque penalty; writes the gradient of it plus an energy in q, dq and ddq, (3, J, T).

    The energy is Σ weight · w τ², summed over parameter sets (K, 10 J) with their terms, joints and time, for
    the sets' weights (K,) and the joints' weights w. The signals must be those of the states.
    """
    (terms, signals), (sets, weights) = extra, directions
    count, cost, roots = states.shape[3], 0.0, terms.roots
    for e in range(len(signals.pushes)):
        clear(signals.pushes[e])
    step = step_of(count)
    for start in range(0, count, step):
        block = 0, start, min(step, count - start)
        enter(chain, states, block, step, work)
        for k in range(len(weights)):
            if weights[k] == 0:
                continue
            forces(chain, sets[k], work, step)
            add_torques(terms, signals, k, block, work.torque)
            for j in range(len(roots)):
                torque, factor = work.torque[j], 2.0 * weights[k] * roots[j] * roots[j]
                for n in range(min(step, LANES)):
                    torque[n] *= factor
            push(chain, sets[k], work, step)
            push_terms(terms, signals, k, block, work.torque)
        if limits.torque_weight > 0:
            forces(chain, limits.parameters, work, step)
            cost += keep(limits, work, block[2])
            push(chain, limits.parameters, work, step)
        pull(chain, work, slope, block, step)
    pull_terms(terms, signals, slope)
    return cost
