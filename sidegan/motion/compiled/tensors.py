"""Former names of compiled operations, for callers that are being rewritten."""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

from torch import Tensor

from sidegan.motion.backend import usable
from sidegan.motion.compiled.chain import Chain
from sidegan.motion.compiled.limits import Limits, Near
from sidegan.motion.spectrum import extremes
from sidegan.motion.threads import eigh

__all__ = ["eigh", "extremes", "penalised_slopes", "sums", "usable"]


def sums(chain: Chain, columns: Tensor, states: Sequence[Tensor], torque: Tensor) -> Tensor:
    """Now ``RigidBody.sums``."""
    from sidegan.motion.compiled import operations

    body: Any = SimpleNamespace(chain=chain, base=SimpleNamespace(columns=columns))
    return operations.sums(body, states, torque)


def penalised_slopes(
    chain: Chain, states: Sequence[Tensor], sets: Tensor, weights: Tensor, limits: Limits, near: Near | None
) -> tuple[Tensor, list[Tensor]]:
    """Now ``RigidBody.penalised_slopes``."""
    from sidegan.motion.compiled import operations

    body: Any = SimpleNamespace(chain=chain)
    return operations.penalised_slopes(body, states, sets, weights, limits, near)
