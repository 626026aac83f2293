"""Friction and rotor inertia of the joints."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sidegan.base.arrays import Array
from sidegan.errors import ShapeError
from sidegan.robot import xml

if TYPE_CHECKING:
    from sidegan.robot.tree import Joint

_STATED = "damping", "friction", "armature"  # attributes of <dynamics>; the last only from an MJCF


@dataclass(frozen=True, eq=False)
class Drives:
    """Friction and rotor inertia of the joints; float64."""

    viscous: Array  # [N·m·s/rad or N·s/m], (J,)
    coulomb: Array  # [N·m or N], (J,)
    rotor_inertia: Array  # reflected to the joint [kg·m² or kg], (J,)

    def __post_init__(self) -> None:
        shapes = {x.shape for x in vars(self).values()}
        if len(shapes) != 1 or self.viscous.ndim != 1:
            raise ShapeError(f"friction and rotors are {sorted(shapes)}, expected one number per joint each")

    def smooth(self, dq: Array, ddq: Array) -> Array:
        """Torque of rotors and viscous friction [N·m or N] at velocities and accelerations, (…, J) each."""
        return self.viscous * dq + self.rotor_inertia * ddq

    def torque(self, dq: Array, ddq: Array) -> Array:
        """Torque of rotors and all friction [N·m or N] at velocities and accelerations, (…, J) each."""
        return self.smooth(dq, ddq) + self.coulomb * np.sign(dq)

    @classmethod
    def none(cls, joints: int) -> "Drives":
        """No friction and no rotors."""
        return cls(*(np.zeros(joints) for _ in range(3)))


def described_drives(moving: Sequence["Joint"], where: str) -> Drives | None:
    """Friction and rotor inertia of moving joints in a description; None if it states none."""
    rows = []
    for joint in moving:
        at = f"{where}: joint {joint.name!r}"
        rows.append([max(xml.number(joint.part("dynamics"), key, at, "0"), 0.0) for key in _STATED])
    columns = np.array(rows, dtype=float).T
    return Drives(*columns) if columns.any() else None
