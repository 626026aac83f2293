"""What an arm carries, from a model of the arm and a recording with the load."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from sidegan.errors import ConfigError, ShapeError
from sidegan.identification.estimate import Estimate, estimate
from sidegan.identification.gather import residual_of
from sidegan.identification.measurements import Measurements, Samples, pieces
from sidegan.identification.model import TorqueModel
from sidegan.identification.program import Task, least_eigenvalues, most_likely
from sidegan.motion.dynamics import LINK_PARAMETERS, RigidBody

_LEAST_MASS, _LEAST_LENGTH = 1e-3, 1e-2  # [kg], [m] of a load that is hardly there
_MARGIN = 1e-4  # smallest eigenvalue of the load's pseudo-inertia in its own mass and length
_SAME = torch.eye(len(LINK_PARAMETERS), dtype=torch.float64)


class PayloadModel:
    """A model of the torque that a load in the last joint's frame adds, linear in its ten parameters."""

    def __init__(self, body: RigidBody) -> None:
        self.body, self.names = body, list(LINK_PARAMETERS)
        self.count = len(self.names)

    @property
    def joints(self) -> int:
        """Number of joints J."""
        return self.body.joints

    def regressor(self, q: Tensor, dq: Tensor, ddq: Tensor, sign: Tensor | None = None) -> Tensor:
        """Regressor, (S, J, 10), of states (S, J); friction's sign plays no part."""
        return self.body.regressor(q, dq, ddq)[..., -self.count :]


@dataclass(frozen=True, eq=False)
class Payload:
    """What an arm carries, rigidly fixed to its last link.

    Attributes:
        parameters: in Pinocchio's order about the last joint's frame, (10,).
        deviation: standard deviation of each, (10,), for an arm that is known exactly.
        exists: whether a rigid body can have these parameters.
        possible: the most likely ones that a rigid body can have, (10,); the same where ``exists``.
        estimate: all that is known about them.
    """

    parameters: Tensor
    deviation: Tensor
    exists: bool
    possible: Tensor
    estimate: Estimate

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        return float(self.parameters[0])

    @property
    def centre(self) -> Tensor:
        """Centre of mass [m] in the last joint's frame, (3,)."""
        return self.parameters[1:4] / self.parameters[0]


def identify_payload(
    model: TorqueModel, parameters: Tensor, measurements: Samples, method: str = "weighted", **settings: Any
) -> Payload:
    """Mass, centre and inertia of a load from a recording with it, the arm's own model being fixed.

    Args:
        model: of the arm without the load.
        parameters: of that model, identified before, (P,).
        measurements: recordings with the load.
        method: estimator, as for ``estimate``; not one that needs the description of an arm.
        settings: of the method.

    Raises:
        ConfigError: when the method cannot be used here; otherwise as ``estimate``.
        ShapeError: when the parameters do not fit the model, and otherwise as ``estimate``.
    """
    if method in ("ridge", "consistent"):
        raise ConfigError(f"{method} pulls towards an arm's description, which says nothing about a load")
    if parameters.shape != (model.count,):
        raise ShapeError(f"parameters are {tuple(parameters.shape)}, the model has {model.count}")
    left = _Left(model, parameters, measurements)
    rest: Samples = iter(left) if isinstance(measurements, Iterator) else left
    load = estimate(method, PayloadModel(model.body), rest, **settings)
    mass = load.parameters[:1].clamp_min(_LEAST_MASS)
    length = (load.parameters[[4, 6, 9]].sum() / 2 / mass).clamp_min(_LEAST_LENGTH**2).sqrt()
    exists = bool((least_eigenvalues(load.parameters[None], mass, length) > 0).all())
    possible = load.parameters
    if not exists:
        nothing = torch.zeros(1, 10, dtype=torch.float64)
        possible = most_likely(
            Task(load.information, load.moment, _SAME, mass, length, nothing, "none", 0.0, _MARGIN)
        )
    return Payload(load.parameters, load.deviation, exists, possible, load)


@dataclass(frozen=True, eq=False)
class _Left:
    """Measurements whose torque is what the arm's model leaves unexplained; read anew at every walk."""

    model: TorqueModel
    parameters: Tensor
    measurements: Samples

    def __iter__(self) -> Iterator[Measurements]:
        for part in pieces(self.measurements):
            yield Measurements(*part.states, residual_of(self.model, part, self.parameters))
