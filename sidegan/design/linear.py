"""Models of torque that are linear in their parameters: rigid bodies, friction and rotors."""

from typing import Any, Protocol

import torch
from torch import Tensor

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


def with_terms(model: Linear, rigid: Tensor, dq: Tensor, ddq: Tensor) -> Tensor:
    """A model's regressor (S, J, P) from that of its rigid bodies (S, J, R), differentiable in all."""
    if not len(model.extras):
        return torch.cat([rigid], 2)
    joints = dq.shape[1]
    signals = torch.stack(model.terms.signals(dq, ddq, model.stribeck))
    term, joint = model.extras // joints, model.extras % joints
    own = torch.nn.functional.one_hot(joint, joints).T.to(dq)  # (J, E)
    return torch.cat([rigid, own * signals[term, :, joint].T[:, None]], 2)
