"""Information of a recording about an arm's base parameters."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from sidegan.motion.dynamics import RigidBody
from sidegan.recording.gravity import friction_columns
from sidegan.recording.recording import Segment

WEAK = 0.05  # share of its own below which a parameter takes twenty times the deviation it would have alone
_SAMPLES_AT_ONCE = 4096
_ROUNDING = 1e-13  # relative eigenvalue that is no information


@dataclass(frozen=True, eq=False)
class Excitation:
    """Information of a recording about the base parameters, (p,) each."""

    names: tuple[str, ...]  # of the base parameters
    # root mean square of the torque that the arm's own value of it makes, over all joints [N·m or N]
    contribution: Tensor
    alone: Tensor  # share of a parameter's regressor column that no other column can stand in for, 0 to 1
    deviation: Tensor  # expected standard deviation of its estimate, for independent errors of ``noise``
    condition_number: float  # of the regressor with columns scaled to one length

    @property
    def weak(self) -> list[str]:
        """Parameters whose column the others nearly stand in for, or that nothing moves."""
        return [name for name, share in zip(self.names, self.alone.tolist()) if share < WEAK]

    def warnings(self) -> list[str]:
        """Base parameters that are hardly excited."""
        if not self.weak:
            return []
        are = "is" if len(self.weak) == 1 else "are"
        return [
            f"{len(self.weak)} of {len(self.names)} base parameters {are} hardly excited (condition number "
            f"{self.condition_number:.3g}): {', '.join(self.weak)}"
        ]

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row per base parameter."""
        keys = ("contribution", "alone", "deviation")
        columns = (getattr(self, key).tolist() for key in keys)
        return [{"name": name, **dict(zip(keys, row))} for name, *row in zip(self.names, *columns)]


def excitation_of(body: RigidBody, segments: Iterable[Segment], noise: Tensor) -> Excitation:
    """Excitation of the base parameters beside friction, with joints weighted by their torque's noise.

    That is the standard deviation of each joint's torque errors [N·m or N], (J,). The arm's own parameters
    give the contributions only.
    """
    values = body.base.values
    count = len(values) + 3 * body.joints
    gram = torch.zeros(count, count, dtype=torch.float64)
    squares, samples = torch.zeros(len(values), dtype=torch.float64), 0
    each = torch.eye(body.joints, dtype=torch.float64)
    for segment in segments:
        for part in zip(*(x.split(_SAMPLES_AT_ONCE) for x in segment[1:4])):
            y = body.base_regressor(*part)
            squares += y.square().sum((0, 1))
            friction = torch.einsum("sjk,ji->sjik", friction_columns(part[1]), each).flatten(2)
            rows = (torch.cat([y, friction], 2) / noise[:, None]).flatten(0, 1)
            gram += rows.T @ rows
            samples += len(y)
    scale = gram.diagonal().sqrt()
    scale = torch.where(scale > 0, scale, torch.ones_like(scale))
    eigenvalues, vectors = torch.linalg.eigh(gram / scale[:, None] / scale)
    floor = _ROUNDING * eigenvalues[-1].clamp_min(1e-300)
    inflation = (vectors.square() / eigenvalues.clamp_min(floor)).sum(1)[: len(values)]
    return Excitation(
        names=body.base.names,
        contribution=(squares / max(samples, 1)).sqrt() * values.abs(),
        alone=inflation.rsqrt().clamp_max(1),
        deviation=inflation.sqrt() / scale[: len(values)],
        condition_number=float((eigenvalues[-1] / eigenvalues[0].clamp_min(floor)).sqrt()),
    )
