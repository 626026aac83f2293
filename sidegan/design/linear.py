"""Models of torque that are linear in their parameters: rigid bodies, friction and rotors."""

from collections.abc import Sequence
from typing import Any, Protocol

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from sidegan.motion.dynamics import RigidBody


class Linear(Protocol):
    """A model of torque that is linear in P parameters: rigid body first, then terms of single joints."""

    body: RigidBody
    extras: Tensor  # term · J + joint of each of the latter

    @property
    def count(self) -> int:
        """Number of parameters P."""

    @property
    def terms(self) -> Any:
        """The terms: their ``kinds`` and ``sign_width``, and ``signals(dq, ddq, stribeck)``."""

    @property
    def stribeck(self) -> Tensor | None:
        """Velocity of each joint's Stribeck term, (J,); None without it."""

    def regressor(self, q: Tensor, dq: Tensor, ddq: Tensor) -> Tensor:
        """Regressor Y, (S, J, P), of states (S, J), with torque = Y θ [N·m or N]."""


def torques(model: Linear, states: Sequence[Tensor], sets: Tensor) -> Tensor:
    """Torques (B, K, T, J) of a model's parameter sets (B, K, P), differentiable in the states (B, T, J)."""
    (q, dq, ddq), rigid = states, len(model.body.base.columns)
    full = sets.new_zeros(*sets.shape[:2], 10 * model.body.joints)
    full[..., model.body.base.columns] = sets[..., :rigid]
    torque = model.body.torques_of(q, dq, ddq, full)
    if not len(model.extras):
        return torque
    term, joint = model.extras // model.body.joints, model.extras % model.body.joints
    signals = torch.stack(model.terms.signals(dq, ddq, model.stribeck))[term, :, :, joint]  # (E, B, T)
    return torque.index_add(3, joint, torch.einsum("ebt,bke->bkte", signals, sets[..., rigid:]))


def weighted_products(model: Linear, states: Sequence[Tensor], rows: Tensor, columns: Tensor) -> Tensor:
    """Products YᵀY of a model's weighted regressor, (B, P, P), differentiable in the states (B, T, J).

    The weights are those of joints, by which rows count, (J,), and of parameters, (P,).
    """
    return _Products.apply(*states, model, rows, columns)


class _Products(torch.autograd.Function):
    """As of a spectrum (``design.objective``): for eigenpairs of the slope the torques of eigenvectors."""

    @staticmethod
    def forward(
        ctx: Any, q: Tensor, dq: Tensor, ddq: Tensor, model: Linear, rows: Tensor, columns: Tensor
    ) -> Tensor:
        ctx.save_for_backward(q, dq, ddq, rows, columns)
        ctx.model = model
        states = [x.reshape(-1, x.shape[2]) for x in (q, dq, ddq)]
        y = model.regressor(*states) * rows[:, None] * columns
        y = y.unflatten(0, q.shape[:2]).flatten(1, 2)
        return y.mT @ y

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, slope: Tensor) -> tuple[Tensor | None, ...]:
        *states, rows, columns = ctx.saved_tensors
        values, vectors = torch.linalg.eigh((slope + slope.mT) / 2)
        with torch.enable_grad():
            x = [state.detach().requires_grad_(True) for state in states]
            energy = ((torques(ctx.model, x, vectors.mT * columns) * rows) ** 2).sum((2, 3))
            return (*torch.autograd.grad((values * energy).sum(), x), None, None, None)
