"""Friction and rotor inertia of the joints."""

from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array, numbers
from sidegan.errors import ShapeError

_AT_REST = 9  # digits of a velocity: smaller ones are rounding, and have no sign


@dataclass(frozen=True, eq=False)
class Drives:
    """Friction and rotor inertia of the joints; float64."""

    viscous: Array  # [N·m·s/rad or N·s/m], (J,)
    coulomb: Array  # [N·m or N], (J,)
    rotor_inertia: Array  # reflected to the joint [kg·m² or kg], (J,)

    def __post_init__(self) -> None:
        for name, given in [*vars(self).items()]:
            object.__setattr__(self, name, numbers(given, name))  # since the class is frozen
        shapes = {x.shape for x in vars(self).values()}
        if len(shapes) != 1 or self.viscous.ndim != 1:
            raise ShapeError(f"friction and rotors are {sorted(shapes)}, expected one number per joint each")

    def require_joints(self, joints: int) -> None:
        """Raise unless there is one finite number per joint each."""
        if self.viscous.shape != (joints,) or not np.isfinite([*vars(self).values()]).all():
            raise ShapeError(f"friction and rotors are {vars(self)}, expected {joints} finite numbers each")

    def smooth(self, dq: Array, ddq: Array) -> Array:
        """Torque of rotors and viscous friction [N·m or N] at velocities and accelerations, (…, J) each."""
        return self.viscous * dq + self.rotor_inertia * ddq

    def torque(self, dq: Array, ddq: Array) -> Array:
        """Torque of rotors and all friction [N·m or N] at velocities and accelerations, (…, J) each."""
        return self.smooth(dq, ddq) + self.coulomb * np.sign(np.round(dq, _AT_REST))

    @classmethod
    def none(cls, joints: int) -> "Drives":
        """No friction and no rotors."""
        return cls(np.zeros(joints), np.zeros(joints), np.zeros(joints))
