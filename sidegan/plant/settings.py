"""What the plant has that a rigid body has not, and what its sensors see."""

from dataclasses import dataclass, field, fields

import torch
from torch import Tensor

from sidegan.base.typed import NonNegative, Positive, Share
from sidegan.errors import ConfigError


def _none() -> list[float]:
    """One value, which stands for every joint."""
    return [0.0]


@dataclass(frozen=True)
class PlantSettings:
    """Friction, drives, servos and sensors; a list holds a value per joint, or one for all joints.

    The units are those of revolute joints; for prismatic ones read N for N·m, m for rad and kg for kg·m².
    Without arguments it is an arm without friction, with perfect sensors and a controller that knows it.
    """

    rate: Positive = 1000.0  # [Hz] of the servos, and of the recording
    viscous: list[NonNegative] = field(default_factory=_none)  # friction [N·m·s/rad]
    coulomb: list[NonNegative] = field(default_factory=_none)  # friction [N·m]
    rotor_inertia: list[NonNegative] = field(default_factory=_none)  # seen from the joint's side [kg·m²]
    bandwidth: list[Positive] = field(default_factory=lambda: [10.0])  # of the position servo [Hz]
    damping_ratio: list[Positive] = field(default_factory=lambda: [1.0])  # of the position servo
    feed_forward: Share = 1.0  # share of the inverse dynamics that the controller adds; it knows no friction
    tolerance: Positive = 0.1  # [rad] off the reference at which the execution has failed
    encoder_resolution: list[NonNegative] = field(default_factory=_none)  # [rad]
    torque_noise: list[NonNegative] = field(default_factory=_none)  # standard deviation [N·m]
    torque_bias: list[float] = field(default_factory=_none)  # [N·m]

    def of(self, name: str, joints: int) -> Tensor:
        """One setting as a value per joint, (J,), float64.

        Raises:
            ConfigError: when it has neither one value nor J.
        """
        values = getattr(self, name)
        if len(values) not in (1, joints):
            raise ConfigError(
                f"plant.{name} has {len(values)} values, expected {joints} (one per joint) or one"
            )
        return torch.tensor(values, dtype=torch.float64).expand(joints)

    def check(self, joints: int) -> None:
        """Raise unless every setting fits an arm of so many joints.

        Raises:
            ConfigError: when one does not.
        """
        for one in fields(self):
            if isinstance(getattr(self, one.name), list):
                self.of(one.name, joints)
