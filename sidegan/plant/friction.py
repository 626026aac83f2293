"""Friction and ripple that no linear model has.

The law differs in form from the smooth basis with which ``identification.unmodelled`` explains residuals.
"""

from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.typed import NonNegative, Positive, Share


@dataclass(frozen=True, kw_only=True)
class FrictionSettings:
    """Sizes; a size of zero switches its part off."""

    # range of the Coulomb friction, as a share of the joint's torque
    coulomb: tuple[Share, Share] = (0.05, 0.2)
    # range of the viscous friction at top speed, of Coulomb's
    viscous: tuple[NonNegative, NonNegative] = (0.3, 1.0)
    width: Positive = 0.03  # speed [rad/s] at which the smooth sign is at 76 %
    stribeck: NonNegative = 0.4  # extra friction near rest, of Coulomb's
    load: NonNegative = 0.05  # friction per transmitted torque
    asymmetry: Share = 0.15  # half the difference between the directions, of Coulomb's
    position: Share = 0.15  # friction that changes with the joint's position, of Coulomb's
    ripple: NonNegative = 0.01  # of the joint's torque


@dataclass(frozen=True, kw_only=True)
class Law:
    """Friction of the joints of one plant; every vector is (J,).

    Hess and Soom's curve near rest, a shear-thinning lubricant (Eyring's), saturating load dependence.

    Source: Hess, Soom 1990; Olsson et al. 1998.
    """

    settings: FrictionSettings
    scale: Array  # torque of the joints [N·m or N]
    coulomb: Array  # [N·m or N]
    viscous: Array  # [N·m·s/rad]
    speed: Array  # of the curve near rest [rad/s]
    phase: Array  # (3, J)
    skew: Array  # −1 … 1, how much the directions differ

    @classmethod
    def drawn(
        cls, settings: FrictionSettings, scale: Array, top: Array, random: np.random.Generator
    ) -> "Law":
        """Friction of one plant whose joints have a torque of this scale and a top speed."""
        joints = len(scale)
        coulomb = scale * random.uniform(*settings.coulomb, joints)
        viscous = coulomb / top * random.uniform(*settings.viscous, joints)
        return cls(
            settings=settings,
            scale=scale,
            coulomb=coulomb,
            viscous=viscous,
            speed=random.uniform(0.02, 0.08, joints) * top,
            phase=random.uniform(0, 2 * np.pi, (3, joints)),
            skew=random.uniform(-1, 1, joints),
        )

    def __call__(self, q: Array, dq: Array, load: Array) -> Array:
        """Friction [N·m or N] against the motion, (…, J), with transmitted torques ``load``."""
        s, size, share = np.tanh(dq / self.settings.width), self.settings, load / self.scale
        rest, thin = 1 / (1 + (dq / self.speed) ** 2), 6 * self.speed
        loaded = load**2 / (np.abs(load) + 0.5 * self.scale) * (1 + 0.3 * s * np.tanh(share))
        place = 0.6 * np.cos(q + self.phase[0]) + 0.4 * np.cos(3 * q + self.phase[1])
        wave = np.sin(54 * q + self.phase[2]) * (1 + 0.5 * share)
        level = 1 + size.stribeck * rest + size.asymmetry * self.skew * s + size.position * place
        friction = s * (self.coulomb * level + size.load * loaded)
        return friction + self.viscous * thin * np.arcsinh(dq / thin) + size.ripple * self.scale * wave
