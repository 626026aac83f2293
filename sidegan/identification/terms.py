"""What a joint's torque has beside rigid bodies: rotor inertia and friction."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from sidegan.errors import ConfigError

LETTERS = {"rotor_inertia": "Ia", "viscous": "fv", "coulomb": "fc", "offset": "fo", "stribeck": "fs"}


@dataclass(frozen=True)
class Terms:
    """What a joint's torque has beside rigid bodies.

    Attributes:
        rotor_inertia: Ia · ddq, where the rigid bodies do not explain it already.
        viscous: fv · dq.
        coulomb: fc · tanh(dq / sign_width).
        offset: fo.
        sign_width: velocity [rad/s or m/s] at which the smooth sign is at 76 %.
        stribeck: velocity [rad/s or m/s] at which the extra friction near rest,
            fs · tanh(dq / sign_width) · exp(−(dq / stribeck)²), has fallen to 37 %, one or one per joint;
            None for no such term. ``stribeck_velocities`` finds them from measurements.

    Raises:
        ConfigError: when a velocity is not finite and positive.
    """

    rotor_inertia: bool = True
    viscous: bool = True
    coulomb: bool = True
    offset: bool = True
    sign_width: float = 0.01
    stribeck: float | Sequence[float] | None = None

    def __post_init__(self) -> None:
        stribeck = [] if self.stribeck is None else np.atleast_1d(np.asarray(self.stribeck, float)).tolist()
        for name, values in (("sign_width", [self.sign_width]), ("stribeck", stribeck)):
            if not all(math.isfinite(v) and v > 0 for v in values):
                raise ConfigError(f"{name} is {values}, expected finite velocities above zero")

    @property
    def kinds(self) -> tuple[str, ...]:
        """Names of the terms in use, in the order of their columns."""
        return tuple(name for name in LETTERS if getattr(self, name) not in (None, False))

    def velocities(self, joints: int) -> Tensor | None:
        """Velocity of each joint's Stribeck term, (J,); None without one.

        Raises:
            ConfigError: when there is another number of them.
        """
        if self.stribeck is None:
            return None
        found = torch.as_tensor(self.stribeck, dtype=torch.float64)
        if found.ndim and found.shape != (joints,):
            raise ConfigError(f"there are {len(found)} Stribeck velocities, expected {joints}")
        return found.expand(joints)

    def signals(
        self, dq: Tensor, ddq: Tensor, stribeck: Tensor | None, sign: Tensor | None = None
    ) -> list[Tensor]:
        """What the parameters of each term in use are multiplied with, (S, J) each."""
        if sign is None:
            sign = torch.tanh(dq / self.sign_width)
        values = {"rotor_inertia": ddq, "viscous": dq, "coulomb": sign, "offset": torch.ones_like(dq)}
        if stribeck is not None:
            values["stribeck"] = sign * torch.exp(-((dq / stribeck.to(dq)) ** 2))
        return [values[name] for name in self.kinds]
