"""Compiled dynamics as functions of arrays, and distribution of work among threads."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.threads import threads
from sidegan.kernels import dynamics, information, regressor
from sidegan.kernels.chain import Chain
from sidegan.kernels.links import waves
from sidegan.motion.arrays import array

States = Sequence[Array]

_WORTH_A_THREAD = 1_000  # states, half a millisecond of work


def rows(chain: Chain, columns: Array, states: States) -> Array:
    """Ascending columns (p,) of the regressor, (S, J, p), of states (S, J).

    A view of an array with the states last, for fast products over samples.
    """
    count, joints = states[0].shape
    motion = _states(*(x[None] for x in states))
    of_links = columns_of_links(columns, joints)
    y = np.zeros((len(columns), joints * (count + dynamics.LANES)))
    span = regressor.base_rows(chain, motion, (0, 0, count), of_links, dynamics.dynamics_buffers(chain), y)
    whole = y[:, : joints * span].reshape(len(columns), joints, span)
    return whole[:, :, :count].transpose(2, 1, 0)


def gram_matrices(chain: Chain, columns: Array, states: States, certainty: Array | None) -> Array:
    """Gram matrices YᵀY / T of ascending columns (p,) of the regressor, (B, p, p), of states (B, T, J).

    Each joint's rows of Y are weighted by its certainty, (J,); None: ones.
    """
    batch, count, joints = states[0].shape
    size = len(columns)
    of_links = columns_of_links(columns, joints)
    grams = np.empty((batch, size, size))
    rigid = information.no_terms(joints)
    if certainty is not None:
        rigid = rigid._replace(roots=array(certainty))

    def work(k: slice) -> None:
        y = dynamics.aligned(size, joints * regressor.SPAN)
        motion = _states(*(x[k] for x in states))
        signals = information.signals_for(rigid, count, 0)
        room = dynamics.dynamics_buffers(chain)
        information.weighted_grams(chain, motion, of_links, (rigid, signals), grams[k], room, y)

    share(work, batch, count)
    return grams


def torques(chain: Chain, states: States, parameters: Array) -> Array:
    """Torques (S, J) at states (S, J) of an arm with inertial parameters (J, 10)."""
    count, joints = states[0].shape
    torque = np.empty((joints, count))
    motion = _states(*(x[None] for x in states))
    dynamics.inverse_dynamics(
        chain, motion, array(parameters.ravel()), torque, dynamics.dynamics_buffers(chain)
    )
    return torque.T


def joint_sums(chain: Chain, columns: Array, states: States, torque: Array) -> Array:
    """Each joint's sums of products of columns (p,) and torque, (J, p + 1, p + 1), over states (S, J)."""
    joints = torque.shape[1]
    of_links = columns_of_links(columns, joints)
    size = len(columns) + 1
    count = threads_for(len(torque), len(torque))
    products = np.zeros((count, joints, size, size))
    parts = [np.array_split(x, count) for x in (*states, torque)]

    def work(k: int) -> None:
        motion = _states(*(x[k][None] for x in parts[:3]))
        y = dynamics.aligned(size, joints * regressor.SPAN)
        pulled = array(parts[3][k].T)
        regressor.base_products(
            chain, motion, pulled, of_links, products[k], dynamics.dynamics_buffers(chain), y
        )

    each(work, count)
    return products.sum(0)


def columns_of_links(columns: Array, joints: int) -> regressor.Columns:
    """Ascending columns of the full regressor, for kernels."""
    first = np.searchsorted(columns // 10, np.arange(joints + 1))
    return regressor.Columns(columns % 10, first)


def _states(q: Array, dq: Array, ddq: Array) -> Array:
    """Arrays for kernels, (5, B, J, T), from states (B, T, J)."""
    batch, count, joints = q.shape
    states = np.empty((5, batch, joints, count))
    for row, x in zip(states[2:], (q, dq, ddq)):
        row[...] = x.transpose(0, 2, 1)
    waves(states[2].ravel(), states[0].ravel(), states[1].ravel())
    return states


def threads_for(tasks: int, states: int) -> int:
    """Number of threads worth using for this many tasks and states."""
    return max(1, min(threads(), tasks, states // _WORTH_A_THREAD))


def share(work: Callable[[slice], None], batch: int, states: int) -> None:
    """Run work on slices of a batch, one per thread; each item is as much work as ``states`` states."""
    count = threads_for(batch, batch * states)
    cuts = [batch * k // count for k in range(count + 1)]
    each(lambda k: work(slice(cuts[k], cuts[k + 1])), count)


def each(work: Callable[[int], None], count: int) -> None:
    """Run work 0, 1, … in parallel."""
    if count == 1:
        work(0)
    else:
        list(_pool(os.getpid(), count).map(work, range(count)))


@cache
def _pool(process: int, threads: int) -> ThreadPoolExecutor:
    """Persistent threads of this process; a fork does not inherit its parent's."""
    return ThreadPoolExecutor(threads, "sidegan")
