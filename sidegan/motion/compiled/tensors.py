"""Compiled dynamics as differentiable functions of tensors (CPU, float64).

First derivatives are compiled too. Where a derivative is to be derived again, the plain function that
every one of these is given as its reference takes over.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np
import torch
from torch import Tensor

from sidegan.motion.compiled import compiled
from sidegan.motion.compiled.chain import Chain
from sidegan.motion.compiled.limits import Limits, Near

States = tuple[Tensor, Tensor, Tensor]
Plain = Callable[[Tensor, Tensor, Tensor], Tensor]

_WORTH_A_THREAD = 1_000  # states: half a millisecond of work
_ALONE = 2**14  # numbers: below 2**15 torch works in the thread that it is called in


def usable(*tensors: Tensor) -> bool:
    """Whether kernels take these tensors: on the processor, in float64."""
    return all(x.device.type == "cpu" and x.dtype == torch.float64 for x in tensors) and compiled()


def gram(chain: Chain, columns: Tensor, states: States, plain: Plain) -> Tensor:
    """Gram matrices YᵀY / T of the base regressor, (B, p, p), of states (B, T, J); differentiable.

    Args:
        chain: the arm.
        columns: columns of the full regressor, (p,).
        states: joint position, velocity and acceleration.
        plain: the same function of the states.
    """
    columns, order = columns.sort()
    if torch.equal(order, torch.arange(len(order))):
        return _Gram.apply(*states, columns, chain, plain)
    back = order.argsort()

    def in_order(*states: Tensor) -> Tensor:
        return plain(*states)[:, order][:, :, order]

    return _Gram.apply(*states, columns, chain, in_order)[:, back][:, :, back]


def torques(chain: Chain, states: States, sets: Tensor, plain: Plain) -> Tensor:
    """Torques (B, K, T, J) of states (B, T, J); differentiable in the states.

    Args:
        chain: the arm.
        states: joint position, velocity and acceleration.
        sets: parameter sets, (B, K, 10 J).
        plain: the same function of the states.
    """
    return _Torques.apply(*states, sets, chain, plain)


def sums(chain: Chain, columns: Tensor, states: States, torque: Tensor) -> Tensor:
    """Each joint's sums of products of base columns and torque over S samples, (J, p + 1, p + 1).

    Args:
        chain: the arm.
        columns: columns of the full regressor, ascending, (p,).
        states: joint position, velocity and acceleration, (S, J) each.
        torque: (S, J), the last column of the products.
    """
    size, joints = len(columns), torque.shape[1]
    order = _order(columns, joints)
    threads = _threads(len(torque), len(torque))
    found = np.zeros((threads, joints, size + 1, size + 1))
    parts = [torch.tensor_split(x.detach(), threads) for x in (*states, torque)]

    def work(k: int) -> None:
        given = _states(*(x[k][None] for x in parts[:3]))
        rows = _kernels().aligned(size + 1, joints * _kernels().SPAN)
        pulled = _array(parts[3][k].T)[None]
        _kernels().sums(chain, given, pulled, *order, found[k], _room(joints), rows)

    _each(work, threads)
    return torch.from_numpy(found.sum(0))


def energy_slopes(chain: Chain, states: Sequence[Tensor], sets: Tensor, weights: Tensor) -> list[Tensor]:
    """Gradients in the states, (B, T, J) each, of the sum of weight · |Y v|² over sets and time.

    Args:
        chain: the arm.
        states: joint position, velocity and acceleration, (B, T, J) each.
        sets: parameter vectors v, (B, K, 10 J).
        weights: (B, K).
    """
    return penalised_slopes(chain, states, sets, weights, Limits.none(states[0].shape[2]), None)[1]


def penalised_slopes(
    chain: Chain,
    states: Sequence[Tensor],
    sets: Tensor,
    weights: Tensor,
    limits: Limits,
    near: Near | None,
) -> tuple[Tensor, list[Tensor]]:
    """Penalty, (B,), and gradients, (B, T, J) each, of it and of Σ weight · |Y v|² over sets and time.

    Args:
        chain: the arm.
        states: joint position, velocity and acceleration, (B, T, J) each.
        sets: parameter vectors v, (B, K, 10 J).
        weights: (B, K).
        limits: what limits of the joints cost.
        near: what small distances cost; nothing when None.
    """
    batch, count, joints = states[0].shape
    slope, value = np.empty((3, batch, joints, count)), np.zeros(batch)
    given = _array(sets), _array(weights)

    def work(k: slice) -> None:
        motion = _states(*(x[k] for x in states))
        _kernels().energy_slopes(
            chain, limits, motion, *(x[k] for x in given), value[k], slope[:, k], _room(joints)
        )
        if near is not None:
            cost, push = _close(chain, near.shapes, motion, near.reach)
            value[k] += near.weight * cost
            slope[0, k] += near.weight * push

    _share(work, batch, count)
    return torch.from_numpy(value), [x.transpose(1, 2) for x in torch.from_numpy(slope)]


def closeness(chain: Chain, shapes: Sequence[Tensor], q: Tensor, reach: float) -> tuple[Tensor, Tensor]:
    """Squared shortfalls of distances below ``reach``, summed over time, (B,) [m²], and slopes (B, T, J).

    Args:
        chain: the arm.
        shapes: the fields of ``sidegan.motion.compiled.closeness.Shapes``.
        q: joint position, (B, T, J).
        reach: smallest distance that costs nothing [m].
    """
    batch, count, joints = q.shape
    value, slope = np.zeros(batch), np.zeros((batch, joints, count))

    def work(k: slice) -> None:
        value[k], slope[k] = _close(chain, shapes, _states(q[k], q[k], q[k]), reach)

    _share(work, batch, count)
    return torch.from_numpy(value), torch.from_numpy(slope).transpose(1, 2)


def _close(
    chain: Chain, shapes: Sequence[Tensor], states: np.ndarray, reach: float
) -> tuple[np.ndarray, np.ndarray]:
    from sidegan.motion.compiled import closeness as kernel

    _, batch, joints, count = states.shape
    given = kernel.Shapes(*map(_array, shapes))
    value, slope = np.zeros(batch), np.zeros((batch, joints, count))
    kernel.closeness(chain, given, states, reach, value, slope, *kernel.room(given, joints))
    return value, slope


def eigh(x: Tensor) -> tuple[Tensor, Tensor]:
    """Eigenvalues (B, p), ascending, and eigenvectors (B, p, p) of symmetric matrices, not differentiable.

    LAPACK takes one matrix after the other; here torch's threads share them.
    """
    values, vectors = x.new_empty(x.shape[:2]), torch.empty_like(x)

    def work(k: slice) -> None:
        values[k], vectors[k] = torch.linalg.eigh(x[k].detach())

    _share(work, len(x), _WORTH_A_THREAD // 20)
    return values, vectors


@torch.no_grad()
def extremes(x: Tensor, low: int, high: int) -> tuple[Tensor, Tensor]:
    """The smallest and largest eigenvalues, ascending, (B, low + high), and eigenvectors (B, p, low + high).

    Not differentiable. All eigenpairs where there are no more than that, or no compiled kernel.
    """
    batch, size, wanted = *x.shape[:2], low + high
    if size <= wanted or not usable(x):
        return eigh(x)
    scale = torch.maximum(x.amax((1, 2)), -x.amin((1, 2))).clamp_min(torch.finfo(x.dtype).tiny)
    a, sound = (x / scale[:, None, None]).contiguous().numpy(), np.zeros(batch, bool)
    values, vectors = np.zeros((batch, wanted)), np.zeros((batch, wanted, size))

    def work(k: slice) -> None:
        from sidegan.motion.compiled import eigen as kernel

        kernel.extremes(a[k], low, values[k], vectors[k], sound[k], *kernel.room(size, wanted))

    _share(work, batch, _WORTH_A_THREAD // 20)
    found, pairs = torch.from_numpy(values) * scale[:, None], torch.from_numpy(vectors).transpose(1, 2)
    if not sound.all():
        rest, ends = torch.from_numpy(~sound), [*range(low), *range(size - high, size)]
        some, others = eigh(x[rest])
        found[rest], pairs[rest] = some[:, ends], others[:, :, ends]
    return found, pairs


class _Gram(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any, q: Tensor, dq: Tensor, ddq: Tensor, columns: Tensor, chain: Chain, plain: Plain
    ) -> Tensor:
        ctx.save_for_backward(q, dq, ddq, columns)
        ctx.chain, ctx.plain = chain, plain
        batch, count, joints = q.shape
        size, order = len(columns), _order(columns, joints)
        grams = np.zeros((batch, size, size))

        def work(k: slice) -> None:
            rows = _kernels().aligned(size, joints * _kernels().SPAN)
            _kernels().grams(chain, _states(q[k], dq[k], ddq[k]), *order, grams[k], _room(joints), rows)

        _share(work, batch, count)
        return torch.from_numpy(grams)

    @staticmethod
    def backward(ctx: Any, cotangent: Tensor) -> tuple[Tensor | None, ...]:
        """The cotangent is Σ weight v vᵀ over its eigenpairs: its product with YᵀY is Σ weight |Y v|²."""
        *states, columns = ctx.saved_tensors
        if torch.is_grad_enabled():
            return (*_again(ctx.plain, states, cotangent), None, None, None)
        weights, vectors = eigh((cotangent + cotangent.transpose(1, 2)) / 2)
        noise = len(columns) * torch.finfo(weights.dtype).eps * weights.abs().amax(1, keepdim=True)
        count = int((weights.abs() > noise).sum(1).max()) if len(weights) else 0
        heaviest = weights.abs().topk(count, 1).indices
        vectors = vectors.gather(2, heaviest[:, None].expand(-1, len(columns), -1))
        sets = cotangent.new_zeros(len(weights), count, 10 * states[0].shape[2])
        sets[:, :, columns] = vectors.transpose(1, 2)
        weights = weights.gather(1, heaviest) / states[0].shape[1]
        return (*energy_slopes(ctx.chain, states, sets, weights), None, None, None)


class _Torques(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any, q: Tensor, dq: Tensor, ddq: Tensor, sets: Tensor, chain: Chain, plain: Plain
    ) -> Tensor:
        ctx.save_for_backward(q, dq, ddq, sets)
        ctx.chain, ctx.plain = chain, plain
        batch, count, joints = q.shape
        found, parameters = np.empty((batch, sets.shape[1], joints, count)), _array(sets)

        def work(k: slice) -> None:
            _kernels().torques(chain, _states(q[k], dq[k], ddq[k]), parameters[k], found[k], _room(joints))

        _share(work, batch, count)
        return torch.from_numpy(found).transpose(2, 3)

    @staticmethod
    def backward(ctx: Any, cotangent: Tensor) -> tuple[Tensor | None, ...]:
        *states, sets = ctx.saved_tensors
        if torch.is_grad_enabled():
            return (*_again(ctx.plain, states, cotangent), None, None, None)
        batch, count, joints = states[0].shape
        slope, given = np.empty((3, batch, joints, count)), (_array(sets), _array(cotangent.transpose(2, 3)))

        def work(k: slice) -> None:
            motion = _states(*(x[k] for x in states))
            _kernels().slopes(ctx.chain, motion, *(x[k] for x in given), slope[:, k], _room(joints))

        _share(work, batch, count)
        return (*(x.transpose(1, 2) for x in torch.from_numpy(slope)), None, None, None)


def _again(plain: Plain, states: list[Tensor], cotangent: Tensor) -> list[Tensor | None]:
    """Slopes of the plain function that can be derived again."""
    wanted = [x for x in states if x.requires_grad]
    found = iter(torch.autograd.grad(plain(*states), wanted, cotangent, create_graph=True))
    return [next(found) if x.requires_grad else None for x in states]


def _kernels() -> ModuleType:
    from sidegan.motion.compiled import dynamics

    return dynamics


def _room(joints: int) -> np.ndarray:
    return _kernels().room(joints)


def _order(columns: Tensor, joints: int) -> tuple[np.ndarray, np.ndarray]:
    """Which of its link's ten parameters each column is, (p,); each link's first column and p, (J + 1,)."""
    return (columns % 10).numpy(), torch.searchsorted(columns // 10, torch.arange(joints + 1)).numpy()


def _states(q: Tensor, dq: Tensor, ddq: Tensor) -> np.ndarray:
    """What kernels take of states (B, T, J), (5, B, J, T)."""
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


def _array(x: Tensor) -> np.ndarray:
    return x.detach().contiguous().numpy()


def _threads(tasks: int, states: int) -> int:
    """How many of torch's threads so much work is worth."""
    return max(1, min(torch.get_num_threads(), tasks, states // _WORTH_A_THREAD))


def _share(work: Callable[[slice], None], batch: int, count: int) -> None:
    """Do work on slices of a batch of trajectories of ``count`` states, one per thread of torch's."""
    threads = _threads(batch, batch * count)
    cuts = [batch * k // threads for k in range(threads + 1)]
    _each(lambda k: work(slice(cuts[k], cuts[k + 1])), threads)


def _each(work: Callable[[int], None], count: int) -> None:
    """Do work 0, 1, … at the same time, the first of it here."""
    others = [_pool(os.getpid(), count - 1).submit(work, k) for k in range(1, count)]
    try:
        work(0)
    finally:
        wait(others)
    for other in others:
        other.result()


@cache
def _pool(process: int, threads: int) -> ThreadPoolExecutor:
    """Threads that stay, of this process: a fork has none of its parent's."""
    return ThreadPoolExecutor(threads, "sidegan")
