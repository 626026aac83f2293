"""What a joint's torque has beside rigid bodies: rotor inertia and friction."""

from dataclasses import dataclass

import torch
from torch import Tensor

from sidegan.base.typed import Positive

LETTERS = {"rotor_inertia": "Ia", "viscous": "fv", "coulomb": "fc", "offset": "fo", "stribeck": "fs"}


@dataclass(frozen=True)
class Terms:
    """What a joint's torque has beside rigid bodies."""

    rotor_inertia: bool  # Ia · ddq, where the rigid bodies do not explain it already
    viscous: bool  # fv · dq
    coulomb: bool  # fc · tanh(dq / sign_width)
    offset: bool  # fo
    # the extra friction near rest, fs · tanh(dq / sign_width) · exp(−(dq / v)²), with a velocity v of each
    # joint that ``stribeck_velocities`` finds from measurements
    stribeck: bool
    sign_width: Positive  # velocity [rad/s or m/s] at which the smooth sign is at 76 %

    @property
    def kinds(self) -> tuple[str, ...]:
        """Names of the terms in use, in the order of their columns."""
        return tuple(name for name in LETTERS if getattr(self, name))

    def signals(
        self, dq: Tensor, ddq: Tensor, stribeck: Tensor | None, sign: Tensor | None = None
    ) -> list[Tensor]:
        """What the parameters of each term in use are multiplied with, (S, J) each.

        Args:
            dq: joint velocity, (S, J).
            ddq: joint acceleration, (S, J).
            stribeck: velocity of each joint's Stribeck term, (J,); None without one.
            sign: what Coulomb and Stribeck friction follow, (S, J); tanh(dq / sign_width) when None.
        """
        if sign is None:
            sign = torch.tanh(dq / self.sign_width)
        values = {"rotor_inertia": ddq, "viscous": dq, "coulomb": sign, "offset": torch.ones_like(dq)}
        if stribeck is not None:
            values["stribeck"] = sign * torch.exp(-((dq / stribeck.to(dq)) ** 2))
        return [values[name] for name in self.kinds]


# Of torques from motor currents, and of rigid bodies alone, as simulated measurements are.
FULL = Terms(rotor_inertia=True, viscous=True, coulomb=True, offset=True, stribeck=False, sign_width=0.01)
RIGID = Terms(False, False, False, False, False, sign_width=0.01)
