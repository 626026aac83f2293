"""Settings of the plant: friction, drives and servos."""

from dataclasses import dataclass

import torch
from torch import Tensor

from sidegan.base.typed import Hertz, NonNegative, Positive, Share
from sidegan.errors import ConfigError


@dataclass(frozen=True)
class PlantSettings:
    """Friction, drives and servos; a list holds a value per joint, or one for all joints.

    The units are those of revolute joints; for prismatic ones read N for N·m, m for rad and kg for kg·m².
    """

    rate: Hertz  # [Hz] of the servos, and of the recording
    viscous: list[NonNegative]  # friction [N·m·s/rad]
    coulomb: list[NonNegative]  # friction [N·m]
    rotor_inertia: list[NonNegative]  # seen from the joint's side [kg·m²]
    bandwidth: list[Hertz]  # of the position servo [Hz]
    damping_ratio: list[Positive]  # of the position servo
    feed_forward: Share  # share of the inverse dynamics that the controller adds; it knows no friction
    tolerance: Positive  # [rad] off the reference at which the execution has failed

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


IDEAL = PlantSettings(  # no friction, and a controller that knows the arm
    rate=1000.0,
    viscous=[0.0],
    coulomb=[0.0],
    rotor_inertia=[0.0],
    bandwidth=[10.0],
    damping_ratio=[1.0],
    feed_forward=1.0,
    tolerance=0.1,
)
