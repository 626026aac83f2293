"""Friction and rotor of a joint, beside the links that it moves."""

from dataclasses import dataclass

import torch
from torch import Tensor

from sidegan.errors import ShapeError


@dataclass(frozen=True, eq=False)
class Drives:
    """Friction and rotors of the joints; float64."""

    viscous: Tensor  # [N·m·s/rad or N·s/m], (J,)
    coulomb: Tensor  # [N·m or N], (J,)
    rotor_inertia: Tensor  # behind the gears [kg·m² or kg], (J,)

    def __post_init__(self) -> None:
        shapes = {tuple(x.shape) for x in vars(self).values()}
        if len(shapes) != 1 or self.viscous.ndim != 1:
            raise ShapeError(f"friction and rotors are {sorted(shapes)}, expected one number per joint each")

    @classmethod
    def none(cls, joints: int) -> "Drives":
        """No friction and no rotors."""
        return cls(*(torch.zeros(joints, dtype=torch.float64) for _ in range(3)))
