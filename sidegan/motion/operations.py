"""Compiled dynamics as functions of tensors on the processor, in float64; none is differentiable."""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from sidegan.kernels import dynamics, eigen, information, regressor
from sidegan.kernels.chain import Chain
from sidegan.motion.arrays import array
from sidegan.motion.threads import AS_STATES, each, eigh, share, threads_for

States = Sequence[Tensor]

_ALONE = 2**14  # numbers: below 2**15 torch works in the thread that it is called in


def rows(chain: Chain, columns: Tensor, states: States) -> Tensor:
    """Ascending columns (p,) of the regressor, (S, J, p), of states (S, J).

    A view of an array with the states last, in which products over samples are fast.
    """
    count, joints = states[0].shape
    motion, of_links = _states(*(x[None] for x in states)), columns_of_links(columns, joints)
    y = np.zeros((len(columns), joints * (count + dynamics.LANES)))
    span = regressor.rows_of(chain, motion, (0, 0, count), of_links, dynamics.scratch(chain), y)
    whole = torch.from_numpy(y[:, : joints * span]).unflatten(1, (joints, span))
    return whole[:, :, :count].permute(2, 1, 0)


def gram(chain: Chain, columns: Tensor, states: States) -> Tensor:
    """Gram matrices YᵀY / T of ascending columns (p,) of the regressor, (B, p, p), of states (B, T, J)."""
    batch, count, joints = states[0].shape
    size, of_links = len(columns), columns_of_links(columns, joints)
    grams, rigid = np.empty((batch, size, size)), information.no_terms(joints)

    def work(k: slice) -> None:
        y = dynamics.aligned(size, joints * regressor.SPAN)
        motion, room = _states(*(x[k] for x in states)), dynamics.scratch(chain)
        signals = information.signals_for(rigid, count, 0)
        information.weighted_grams(chain, motion, of_links, (rigid, signals), grams[k], room, y)

    share(work, batch, count)
    return torch.from_numpy(grams)


def torques(chain: Chain, states: States, parameters: Tensor) -> Tensor:
    """Torques (S, J) of states (S, J) of an arm with inertial parameters (J, 10)."""
    count, joints = states[0].shape
    torque = np.empty((1, 1, joints, count))
    sets = array(parameters.reshape(1, 1, -1))
    dynamics.torques(chain, _states(*(x[None] for x in states)), sets, torque, dynamics.scratch(chain))
    return torch.from_numpy(torque[0, 0].T)


def sums(chain: Chain, columns: Tensor, states: States, torque: Tensor) -> Tensor:
    """Each joint's sums of products of columns (p,) and torque, (J, p + 1, p + 1), over S samples (S, J)."""
    joints = torque.shape[1]
    of_links = columns_of_links(columns, joints)
    size, threads = len(columns) + 1, threads_for(len(torque), len(torque))
    products = np.zeros((threads, joints, size, size))
    parts = [torch.tensor_split(x.detach(), threads) for x in (*states, torque)]

    def work(k: int) -> None:
        motion = _states(*(x[k][None] for x in parts[:3]))
        y = dynamics.aligned(size, joints * regressor.SPAN)
        pulled = array(parts[3][k].T)[None]
        regressor.sums(chain, motion, pulled, of_links, products[k], dynamics.scratch(chain), y)

    each(work, threads)
    return torch.from_numpy(products.sum(0))


@torch.no_grad()
def extremes(x: Tensor, low: int, high: int) -> tuple[Tensor, Tensor]:
    """The smallest and largest eigenvalues, ascending, (B, low + high), and eigenvectors (B, p, low + high).

    All eigenpairs where there are no more than that.
    """
    batch, size, count = *x.shape[:2], low + high
    if size <= count:
        return eigh(x)
    scale = torch.maximum(x.amax((1, 2)), -x.amin((1, 2))).clamp_min(torch.finfo(x.dtype).tiny)
    a, sound = (x / scale[:, None, None]).contiguous().numpy(), np.zeros(batch, bool)
    values, vectors = np.zeros((batch, count)), np.zeros((batch, count, size))

    def work(k: slice) -> None:
        eigen.extremes(a[k], low, values[k], vectors[k], sound[k], *eigen.scratch(size, count))

    share(work, batch, AS_STATES)
    pairs = torch.from_numpy(values) * scale[:, None], torch.from_numpy(vectors).transpose(1, 2)
    if not sound.all():
        rest, ends = torch.from_numpy(~sound), [*range(low), *range(size - high, size)]
        for x_of_all, x_of_rest in zip(pairs, eigh(x[rest])):
            x_of_all[rest] = x_of_rest[..., ends]
    return pairs


def columns_of_links(columns: Tensor, joints: int) -> regressor.Columns:
    """Ascending columns of the full regressor as kernels take them."""
    first = torch.searchsorted(columns // 10, torch.arange(joints + 1))
    return regressor.Columns((columns % 10).numpy(), first.numpy())


def _states(q: Tensor, dq: Tensor, ddq: Tensor) -> np.ndarray:
    """Arrays for kernels, (5, B, J, T), of states (B, T, J)."""
    batch, count, joints = q.shape
    states = np.empty((5, batch, joints, count))
    for row, x in zip(states[2:], (q, dq, ddq)):
        row[...] = x.detach().numpy().transpose(0, 2, 1)
    # In pieces that torch does not share among its threads: those would wait beside ours, and busily.
    sine, cosine, position = (x.split(_ALONE) for x in torch.from_numpy(states[:3]).flatten(1))
    for s, c, x in zip(sine, cosine, position):
        torch.sin(x, out=s)
        torch.cos(x, out=c)
    return states
