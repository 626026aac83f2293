"""One trajectory's fitness and worst margins at its samples, compiled from end to end.

What an optimiser without gradients asks ten thousand times, without the overhead of a call for each part.
"""

import math
from typing import NamedTuple

import numpy as np

from sidegan.kernels import eigen, lanes, regressor
from sidegan.kernels.chain import Array, Chain, Shapes
from sidegan.kernels.distances import between_segments, to_region
from sidegan.kernels.formulas import dot, less
from sidegan.kernels.goals import to_orthonormal
from sidegan.kernels.jit import inline, kernel
from sidegan.kernels.links import Frames, frames, joint, locate, place_capsules, placement, row
from sidegan.kernels.signals import combine, largest, within

# Numbers of a trajectory.
FITNESS, POSITION, VELOCITY, TORQUE, COLLISION, KEEP_OUT, ACCELERATION, JERK, NUMBERS = range(9)
_EPS = float(np.finfo(np.float64).eps)
_BLOCK = 512  # samples of all joints that stay near the processor while a basis function passes by


class Subject(NamedTuple):
    """An arm in its workspace, and the samples at which its trajectories are evaluated."""

    chain: Chain
    shapes: Shapes
    columns: regressor.Columns  # base columns, ascending
    subspace: Array  # lower triangular C; Cᵀ YᵀY C has the spectrum in an orthonormal basis, (p, p)
    parameters: Array  # inertial parameters, (1, 1, 10 J)
    home: Array  # position that trajectories start from, (J,) [rad or m]
    lower: Array  # position limits, (J,)
    upper: Array  # position limits, (J,)
    speed: Array  # velocity limits, (J,)
    higher: Array  # limits of acceleration and jerk, (2, J); (2, 0) where there are none
    torque: Array  # torque limits, (J,); infinite where nothing is limited
    basis: Array  # derivatives 0 to 2, or 3, of the K basis functions at the T samples, (3 or 4, K, T)


class Measure(NamedTuple):
    """What the numbers mean."""

    diagonal: bool  # diagonal fitness instead of the eigenvalue fitness
    weakest: int  # rank, from the smallest, of the eigenvalue that the largest is divided by
    hopeless: float  # stands for an infinite fitness
    distance: float  # clearance that counts like a whole limit [m]


class Room(NamedTuple):
    """Room for the kernel at work; not to be shared among threads."""

    lines: Array  # jerks at a block of the samples, (J, _BLOCK)
    jerk: Array  # largest one of each joint, (J,)
    states: Array  # (5, 1, J, T)
    torque: Array  # (1, 1, J, T)
    lanes: lanes.Room
    y: Array  # regressor
    gram: Array  # (1, p, p)
    product: Array  # (p, p)
    inner: Array  # (p, p)
    ends: Array  # smallest and largest eigenvalue, (2,)
    rows: Array  # of ``eigen``
    shifts: Array  # of ``eigen``
    world: Frames
    capsules: Array  # end points of the capsules' axes, and the middles between them, (3, C, 3)


def room(subject: Subject) -> Room:
    """Room to evaluate trajectories of a subject."""
    joints, size = len(subject.home), len(subject.columns.kinds)
    samples = subject.basis.shape[2]
    return Room(
        lanes.aligned(joints, _BLOCK),
        np.zeros(joints),
        lanes.aligned(5, 1, joints, samples),
        lanes.aligned(1, 1, joints, samples),
        lanes.room(joints),
        lanes.aligned(size, joints * regressor.SPAN),
        np.zeros((1, size, size)),
        np.zeros((size, size)),
        np.zeros((size, size)),
        np.zeros(2),
        *eigen.room(size, 2),
        frames(joints),
        np.zeros((3, len(subject.shapes.frame), 3)),
    )


@kernel
def _roll_out(subject: Subject, x: Array, work: Room) -> None:
    """Write the states of a trajectory with coefficients (J, K)."""
    states = work.states
    samples = states.shape[3]
    for order, state in ((0, lanes.Q), (1, lanes.DQ), (2, lanes.DDQ)):
        for j in range(len(subject.home)):
            for n in range(samples):
                states[state, 0, j, n] = subject.home[j] if order == 0 else 0.0
        for first in range(0, samples, _BLOCK):
            count = min(_BLOCK, samples - first)
            combine(x, subject.basis[order], first, count, states[state, 0], first)
    for j in range(len(subject.home)):
        for n in range(samples):
            q = states[lanes.Q, 0, j, n]
            states[lanes.SIN, 0, j, n], states[lanes.COS, 0, j, n] = math.sin(q), math.cos(q)


@kernel
def _check_limits(subject: Subject, work: Room, numbers: Array) -> None:
    """Take positions, velocities and torques into account."""
    limited = False
    for j in range(len(subject.home)):
        limited |= math.isfinite(subject.torque[j])
    if limited:
        lanes.torques(subject.chain, work.states, subject.parameters, work.torque, work.lanes)
    for j in range(len(subject.home)):
        low, high, q = subject.lower[j], subject.upper[j], work.states[lanes.Q, 0, j]
        least = 1.0
        if math.isfinite(high - low):
            for n in range(len(q)):
                least = min(least, min(q[n] - low, high - q[n]) / ((high - low) / 2))
        numbers[POSITION] = max(numbers[POSITION], -least)
        speed = within(work.states[lanes.DQ, 0, j], subject.speed[j])
        numbers[VELOCITY] = max(numbers[VELOCITY], -speed)
        if limited:
            numbers[TORQUE] = max(numbers[TORQUE], -within(work.torque[0, 0, j], subject.torque[j]))


@kernel
def _check_higher(subject: Subject, x: Array, work: Room, numbers: Array) -> None:
    """Take accelerations and jerks into account, where some are limited."""
    higher, samples = subject.higher, subject.basis.shape[2]
    for j in range(higher.shape[1]):
        acceleration = within(work.states[lanes.DDQ, 0, j], higher[0, j])
        numbers[ACCELERATION] = max(numbers[ACCELERATION], -acceleration)
        work.jerk[j] = 0.0
    for first in range(0, samples if higher.shape[1] else 0, _BLOCK):
        count = min(_BLOCK, samples - first)
        for j in range(higher.shape[1]):
            lanes.clear(work.lines[j])
        combine(x, subject.basis[3], first, count, work.lines, 0)
        for j in range(higher.shape[1]):
            work.jerk[j] = max(work.jerk[j], largest(work.lines[j], count))
    for j in range(higher.shape[1]):
        share = work.jerk[j] / higher[1, j] if math.isfinite(higher[1, j]) else 0.0
        numbers[JERK] = max(numbers[JERK], share - 1.0)


@inline
def _nearest_pair(shapes: Shapes, ends: Array, least: float) -> float:
    """The smallest distance [m] of a pair of capsules, or ``least`` where that is smaller."""
    for p in range(len(shapes.pairs)):
        i, k = shapes.pairs[p, 0], shapes.pairs[p, 1]
        apart, far = less(row(ends[2], i), row(ends[2], k)), least + shapes.size[i] + shapes.size[k]
        if far <= 0 or dot(apart, apart) < far * far:
            distance = between_segments(row(ends[0], i), row(ends[1], i), row(ends[0], k), row(ends[1], k))
            least = min(least, distance - (shapes.core[i] + shapes.core[k]))
    return least


@inline
def _nearest_region(shapes: Shapes, ends: Array, least: float) -> float:
    """The same for capsules and keep-out regions."""
    for g in range(len(shapes.guarded)):
        r, k = shapes.guarded[g, 0], shapes.guarded[g, 1]
        a, b, middle = row(ends[0], k), row(ends[1], k), row(ends[2], k)
        distance = to_region(shapes, r, a, b, middle, least + shapes.size[k])
        least = min(least, distance - shapes.radius[k])
    return least


@kernel
def _check_distances(subject: Subject, distance: float, work: Room, numbers: Array) -> None:
    """Take collisions and keep-out regions into account."""
    shapes, states = subject.shapes, work.states
    if len(shapes.pairs) + len(shapes.guarded) == 0:
        return
    apart, clear = np.inf, np.inf
    for n in range(states.shape[3]):
        for i in range(states.shape[2]):
            sine, cosine, q = (
                states[lanes.SIN, 0, i, n],
                states[lanes.COS, 0, i, n],
                states[lanes.Q, 0, i, n],
            )
            r, shift = placement(joint(subject.chain, i), sine, cosine, q)
            locate(work.world, i, r, shift)
        place_capsules(shapes, work.world, work.capsules)
        apart = _nearest_pair(shapes, work.capsules, apart)
        clear = _nearest_region(shapes, work.capsules, clear)
    numbers[COLLISION], numbers[KEEP_OUT] = -apart / distance, -clear / distance


@kernel
def _spectral_ratio(subject: Subject, weakest: int, work: Room) -> float:
    """Largest eigenvalue of YᵀY in an orthonormal basis over that of a rank; infinite where that is zero."""
    for i in range(work.gram.shape[1]):
        lanes.clear(work.gram[0, i])
    regressor.grams(subject.chain, work.states, subject.columns, work.gram, work.lanes, work.y)
    inner, scale = work.inner, to_orthonormal(subject.subspace, work.gram[0], work.product, work.inner)
    if not (math.isfinite(scale) and scale > 0):
        return np.inf
    for i in range(len(inner)):
        for j in range(i, len(inner)):
            inner[i, j] /= scale
            inner[j, i] = inner[i, j]
    eigen.ends(work.inner, weakest, work.ends, work.rows, work.shifts)
    low, high = work.ends[0], work.ends[1]
    return high / low if low > len(work.inner) * _EPS * high else np.inf


@kernel
def _diagonal_ratio(subject: Subject, work: Room) -> float:
    """Largest over smallest diagonal element of YᵀY over the base columns."""
    squares = work.gram[0, 0]
    lanes.clear(squares)
    regressor.diagonal(subject.chain, work.states, subject.columns, squares, work.lanes, work.y)
    low, high = np.inf, 0.0
    for p in range(len(squares)):
        low, high = min(low, squares[p]), max(high, squares[p])
    return high / low if low > _EPS * high else np.inf


@kernel
def evaluate(subject: Subject, measure: Measure, x: Array, numbers: Array, work: Room) -> None:
    """Write log fitness and violations, (B, NUMBERS), of trajectories with coefficients (B, J, K) [rad/s].

    A violation is the worst relative margin with its sign turned: positive where the constraint is violated.
    """
    for b in range(len(x)):
        for n in range(NUMBERS):
            numbers[b, n] = -np.inf
        _roll_out(subject, x[b], work)
        _check_limits(subject, work, numbers[b])
        _check_higher(subject, x[b], work, numbers[b])
        _check_distances(subject, measure.distance, work, numbers[b])
        if measure.diagonal:
            ratio = _diagonal_ratio(subject, work)
        else:
            ratio = _spectral_ratio(subject, measure.weakest, work)
        ratio = ratio if ratio < measure.hopeless else measure.hopeless
        numbers[b, FITNESS] = math.log(ratio)
