"""Compiled dynamics as differentiable functions of tensors (CPU, float64).

First derivatives are compiled too. Where a derivative is to be derived again, the plain function that
every one of these is given as its reference takes over.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from types import ModuleType
from typing import Any

import numpy as np
import torch
from torch import Tensor

from sidegan.kernels import compiled
from sidegan.kernels.chain import Chain

States = tuple[Tensor, Tensor, Tensor]
Plain = Callable[[Tensor, Tensor, Tensor], Tensor]

_WORTH_A_THREAD = 1_000  # states: half a millisecond of work


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


def energy_slopes(chain: Chain, states: Sequence[Tensor], sets: Tensor, weights: Tensor) -> list[Tensor]:
    """Gradients in the states, (B, T, J) each, of the sum of weight · |Y v|² over sets and time.

    Args:
        chain: the arm.
        states: joint position, velocity and acceleration, (B, T, J) each.
        sets: parameter vectors v, (B, K, 10 J).
        weights: (B, K).
    """
    batch, count, joints = states[0].shape
    return _slopes(chain, states, sets, weights, weights.new_zeros(batch, 0, joints, count))


def closeness(chain: Chain, shapes: Sequence[Tensor], q: Tensor, reach: float) -> tuple[Tensor, Tensor]:
    """Squared shortfalls of distances below ``reach``, summed over time, (B,) [m²], and slopes (B, T, J).

    Args:
        chain: the arm.
        shapes: the fields of ``sidegan.kernels.closeness.Shapes``.
        q: joint position, (B, T, J).
        reach: smallest distance that costs nothing [m].
    """
    from sidegan.kernels import closeness as kernel

    batch, count, joints = q.shape
    given, states = kernel.Shapes(*map(_array, shapes)), _states(q, q, q)
    value, slope = np.zeros(batch), np.zeros((batch, joints, count))

    def work(k: slice) -> None:
        kernel.closeness(chain, given, states[:, k], reach, value[k], slope[k], *kernel.room(given, joints))

    _share(work, batch, count)
    return torch.from_numpy(value), torch.from_numpy(slope).transpose(1, 2)


def eigh(x: Tensor) -> tuple[Tensor, Tensor]:
    """Eigenvalues (B, p), ascending, and eigenvectors (B, p, p) of symmetric matrices, not differentiable.

    LAPACK takes one matrix after the other; here torch's threads share them.
    """
    values, vectors = x.new_empty(x.shape[:2]), torch.empty_like(x)

    def work(k: slice) -> None:
        values[k], vectors[k] = torch.linalg.eigh(x[k].detach())

    _share(work, len(x), _WORTH_A_THREAD // 20)
    return values, vectors


class _Gram(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any, q: Tensor, dq: Tensor, ddq: Tensor, columns: Tensor, chain: Chain, plain: Plain
    ) -> Tensor:
        ctx.save_for_backward(q, dq, ddq, columns)
        ctx.chain, ctx.plain = chain, plain
        batch, count, joints = q.shape
        size = len(columns)
        first = torch.searchsorted(columns // 10, torch.arange(joints + 1))
        widths = (size - first[:-1]).tolist()
        y, kinds = q.new_empty(batch, sum(widths), count), (columns % 10).numpy()
        states = _states(q, dq, ddq)

        def work(k: slice) -> None:
            _kernels().regressor(chain, states[:, k], kinds, first.numpy(), y[k].numpy(), _room(joints))

        _share(work, batch, count)
        grams = q.new_zeros(batch, size, size)
        for rows in y.split(widths, 1):
            start = size - rows.shape[1]
            grams[:, start:, start:] += rows @ rows.transpose(1, 2)
        return grams / count

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
        found = q.new_empty(batch, sets.shape[1], joints, count)
        states, parameters = _states(q, dq, ddq), _array(sets)

        def work(k: slice) -> None:
            _kernels().torques(chain, states[:, k], parameters[k], found[k].numpy(), _room(joints))

        _share(work, batch, count)
        return found.transpose(2, 3)

    @staticmethod
    def backward(ctx: Any, cotangent: Tensor) -> tuple[Tensor | None, ...]:
        *states, sets = ctx.saved_tensors
        if torch.is_grad_enabled():
            return (*_again(ctx.plain, states, cotangent), None, None, None)
        none = cotangent.new_zeros(len(cotangent), 0)
        return (*_slopes(ctx.chain, states, sets, none, cotangent.transpose(2, 3)), None, None, None)


def _again(plain: Plain, states: list[Tensor], cotangent: Tensor) -> list[Tensor | None]:
    """Slopes of the plain function that can be derived again."""
    wanted = [x for x in states if x.requires_grad]
    found = iter(torch.autograd.grad(plain(*states), wanted, cotangent, create_graph=True))
    return [next(found) if x.requires_grad else None for x in states]


def _slopes(
    chain: Chain, motion: Sequence[Tensor], sets: Tensor, weights: Tensor, cotangents: Tensor
) -> list[Tensor]:
    batch, count, joints = motion[0].shape
    states = _states(*motion)
    slope = np.empty((3, batch, joints, count))
    given = _array(sets), _array(weights), _array(cotangents)

    def work(k: slice) -> None:
        _kernels().slopes(chain, states[:, k], *(x[k] for x in given), slope[:, k], _room(joints))

    _share(work, batch, count)
    return [x.transpose(1, 2) for x in torch.from_numpy(slope)]


def _kernels() -> ModuleType:
    from sidegan.kernels import dynamics

    return dynamics


def _room(joints: int) -> np.ndarray:
    return _kernels().room(joints)


def _states(q: Tensor, dq: Tensor, ddq: Tensor) -> np.ndarray:
    """What kernels take of states (B, T, J), (5, B, J, T)."""
    q, dq, ddq = (x.detach().transpose(1, 2) for x in (q, dq, ddq))
    return torch.stack([torch.sin(q), torch.cos(q), q, dq, ddq]).numpy()


def _array(x: Tensor) -> np.ndarray:
    return x.detach().contiguous().numpy()


def _share(work: Callable[[slice], None], batch: int, count: int) -> None:
    """Do work on slices of a batch of trajectories of ``count`` states, one per thread of torch's."""
    threads = min(torch.get_num_threads(), batch, batch * count // _WORTH_A_THREAD)
    if threads < 2:
        work(slice(0, batch))
        return
    cuts = [batch * k // threads for k in range(threads + 1)]
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, (slice(low, high) for low, high in pairwise(cuts))))
