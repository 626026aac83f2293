"""How well a recording excites each base parameter, before anything is fitted."""

from collections.abc import Iterable
from dataclasses import dataclass

import torch
from torch import Tensor

from sidegan.motion.dynamics import RigidBody
from sidegan.recording.recording import Segment

_SAMPLES_AT_ONCE = 4096
_ROUNDING = 1e-13  # relative eigenvalue that is no information


@dataclass(frozen=True, eq=False)
class Excited:
    """What a recording can tell about the base parameters, (p,) each.

    Attributes:
        names: of the base parameters.
        contribution: root mean square of the torque that the arm's own value of it makes, over all joints
            [N·m or N]. Zero where the description has no such value.
        alone: share of a parameter's regressor column that no other column can stand in for, 0 to 1.
        deviation: expected standard deviation of its estimate, for independent errors of ``noise``.
        condition: of the regressor with columns scaled to one length.
    """

    names: tuple[str, ...]
    contribution: Tensor
    alone: Tensor
    deviation: Tensor
    condition: float

    @property
    def weak(self) -> list[str]:
        """Parameters whose column the others nearly stand in for, or that nothing moves."""
        return [name for name, share in zip(self.names, self.alone.tolist()) if share < WEAK]


SMOOTH = 0.01  # [rad/s] at which the smooth sign of a velocity is at 76 %
WEAK = 0.05  # share of its own below which a parameter takes twenty times the deviation it would have alone


def excited(body: RigidBody, segments: Iterable[Segment], noise: Tensor) -> Excited:
    """How well the base parameters are excited beside friction, with joints weighted by their torque's noise.

    Args:
        body: the arm; its own parameters give the contributions only.
        segments: of one recording or several.
        noise: standard deviation of each joint's torque errors [N·m or N], (J,).
    """
    values = body.base.values
    count = len(values) + 3 * body.joints
    gram = torch.zeros(count, count, dtype=torch.float64)
    squares, samples = torch.zeros(len(values), dtype=torch.float64), 0
    for segment in segments:
        for part in zip(*(x.split(_SAMPLES_AT_ONCE) for x in segment[1:4])):
            y = body.base_regressor(*part)
            squares += y.square().sum((0, 1))
            rows = (torch.cat([y, _friction(part[1])], 2) / noise[:, None]).flatten(0, 1)
            gram += rows.T @ rows
            samples += len(y)
    scale = gram.diagonal().sqrt()
    scale = torch.where(scale > 0, scale, torch.ones_like(scale))
    eigenvalues, vectors = torch.linalg.eigh(gram / scale[:, None] / scale)
    floor = _ROUNDING * eigenvalues[-1].clamp_min(1e-300)
    inflation = (vectors.square() / eigenvalues.clamp_min(floor)).sum(1)[: len(values)]
    contribution = (squares / max(samples, 1)).sqrt() * values.abs()
    condition = float((eigenvalues[-1] / eigenvalues[0].clamp_min(floor)).sqrt())
    deviation = inflation.sqrt() / scale[: len(values)]
    return Excited(body.base.names, contribution, inflation.rsqrt().clamp_max(1), deviation, condition)


def _friction(velocity: Tensor) -> Tensor:
    """What every joint's torque may have beside rigid bodies, of velocities (S, J): (S, J, 3 J)."""
    own = torch.stack([velocity, torch.tanh(velocity / SMOOTH), torch.ones_like(velocity)], 2)
    return torch.einsum("sjk,ji->sjik", own, torch.eye(velocity.shape[1], dtype=velocity.dtype)).flatten(2)
