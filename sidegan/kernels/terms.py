"""Compiled terms of single joints' torques beside rigid bodies: rotor inertia, friction, offset.

They are columns of the regressor that only the rows of their own joint have; ``Terms`` of an identified
model says what each of them is.
"""

import math
from typing import NamedTuple

import numpy as np

from sidegan.kernels.chain import Array
from sidegan.kernels.jit import inline, kernel
from sidegan.kernels.lanes import DDQ, DQ, LANES, Block, clear
from sidegan.kernels.regressor import Columns, tile

KINDS = ("rotor_inertia", "viscous", "coulomb", "offset", "stribeck")
_ROTOR, _VISCOUS, _COULOMB, _OFFSET = range(len(KINDS) - 1)


class JointTerms(NamedTuple):
    """E terms, joints in order."""

    kinds: Array  # which of ``KINDS`` each is, (E,)
    first: Array  # first term of each joint, and E at the end, (J + 1,)
    width: float  # velocity of the smooth sign tanh(dq / width) [rad/s or m/s]
    speeds: Array  # of the Stribeck terms [rad/s or m/s], (J,)


class Signals(NamedTuple):
    """What parameters of the terms are multiplied with; room for the kernels at work."""

    values: Array  # (E, T)
    rates: Array  # slopes in the velocity, of a rotor's in the acceleration, (E, T)
    pushes: Array  # slopes of an energy in the values, (E, T)
    shares: Array  # parameters of the terms in each set, (K, E)


def room(terms: JointTerms, samples: int, sets: int) -> Signals:
    """Room for T samples and K parameter sets."""
    count = len(terms.kinds)
    values, rates, pushes = (np.zeros((count, samples)) for _ in range(3))
    return Signals(values, rates, pushes, np.zeros((sets, count)))


@inline
def _signal(terms: JointTerms, kind: int, j: int, dq: float, ddq: float) -> tuple[float, float]:
    """What a parameter is multiplied with, and its slope."""
    if kind == _ROTOR:
        return ddq, 1.0
    if kind == _VISCOUS:
        return dq, 1.0
    if kind == _OFFSET:
        return 1.0, 0.0
    sign = math.tanh(dq / terms.width)
    steep = (1.0 - sign * sign) / terms.width
    if kind == _COULOMB:
        return sign, steep
    speed = dq / terms.speeds[j]
    near = math.exp(-speed * speed)
    return sign * near, (steep - sign * 2.0 * speed / terms.speeds[j]) * near


@kernel
def write_signals(terms: JointTerms, states: Array, signals: Signals) -> None:
    """Write values and their slopes along a trajectory's states (5, 1, J, T)."""
    for j in range(len(terms.first) - 1):
        for e in range(terms.first[j], terms.first[j + 1]):
            for n in range(states.shape[3]):
                found = _signal(terms, terms.kinds[e], j, states[DQ, 0, j, n], states[DDQ, 0, j, n])
                signals.values[e, n], signals.rates[e, n] = found


@kernel
def add_terms(
    terms: JointTerms, columns: Columns, roots: Array, signals: Signals, block: Block, span: int,
    y: Array, gram: Array,
) -> None:  # fmt: skip
    """Add the terms' products with one another and with the weighted rigid columns of a block.

    The rigid columns are the first rows of y, as ``rows_of`` leaves them; the terms' rows follow. Products
    are added above the diagonal.
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
                row[low + n] = roots[j] * signals.values[e, start + n]
        for q in range(begin, end, 4):
            for p in range(columns.first[j], size, 4):
                tile(y, (p, size), (q, end), low, high, gram)
        for p in range(begin, end, 4):
            for q in range(p, end, 4):
                tile(y, (p, end), (q, end), low, high, gram)


@kernel
def add_torques(terms: JointTerms, signals: Signals, k: int, block: Block, torque: Array) -> None:
    """Add the torques of the terms in set k to those of rigid bodies in lanes (J, LANES)."""
    _, start, count = block
    for j in range(len(torque)):
        for e in range(terms.first[j], terms.first[j + 1]):
            share, values = signals.shares[k, e], signals.values[e]
            for n in range(min(count, LANES)):
                torque[j, n] += share * values[start + n]


@kernel
def push_terms(terms: JointTerms, signals: Signals, k: int, block: Block, torque: Array) -> None:
    """Add the slopes in the terms' values of what has cotangents in place of the torques (J, LANES)."""
    _, start, count = block
    for j in range(len(torque)):
        for e in range(terms.first[j], terms.first[j + 1]):
            share, pushes = signals.shares[k, e], signals.pushes[e]
            for n in range(min(count, LANES)):
                pushes[start + n] += share * torque[j, n]


@kernel
def pull_terms(terms: JointTerms, signals: Signals, slope: Array) -> None:
    """Add the slopes in dq and ddq, of (3, 1, J, T), that follow from those in the values."""
    for j in range(len(terms.first) - 1):
        for e in range(terms.first[j], terms.first[j + 1]):
            to, rates, pushes = (
                slope[2 if terms.kinds[e] == _ROTOR else 1, 0, j],
                signals.rates[e],
                signals.pushes[e],
            )
            for n in range(len(to)):
                to[n] += rates[n] * pushes[n]
