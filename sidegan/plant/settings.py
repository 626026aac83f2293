"""Settings of the plant: friction, drives and servos."""

from dataclasses import dataclass, field

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.typed import Hertz, NonNegative, Positive, Share
from sidegan.errors import ConfigError


@dataclass(frozen=True, kw_only=True)
class PlantSettings:
    """Friction, drives and servos; a list holds a value per joint, or a single one for all joints.

    The units are those of revolute joints; for prismatic ones read N for N·m, m for rad and kg for kg·m².
    """

    rate: Hertz = 1000.0  # [Hz] of the servos, and of the recording
    viscous: list[NonNegative] = field(default_factory=lambda: [2.0])  # friction [N·m·s/rad]
    coulomb: list[NonNegative] = field(default_factory=lambda: [1.0])  # friction [N·m]
    # reflected to the joint [kg·m²]
    rotor_inertia: list[NonNegative] = field(default_factory=lambda: [0.1])
    bandwidth: list[Hertz] = field(default_factory=lambda: [10.0])  # of the position servo [Hz]
    damping_ratio: list[Positive] = field(default_factory=lambda: [1.0])  # of the position servo
    feed_forward: Share = 1.0  # share of the inverse dynamics that the controller adds, without friction
    tolerance: Positive = 0.1  # [rad] tracking error at which the execution has failed

    def of(self, name: str, joints: int) -> Array:
        """A setting as a value per joint, (J,).

        Raises:
            ConfigError: when it has neither one value nor J.
        """
        values = getattr(self, name)
        if len(values) not in (1, joints):
            raise ConfigError(
                f"plant.{name} has {len(values)} values, expected {joints} (one per joint) or one"
            )
        return np.full(joints, values, float)


# Without friction, and with an exact feed-forward.
IDEAL = PlantSettings(viscous=[0.0], coulomb=[0.0], rotor_inertia=[0.0])
