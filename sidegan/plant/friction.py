"""Nonlinear friction and torque ripple, which identified models lack.

The law differs in form from the smooth basis with which ``identification.unmodelled`` explains residuals.
"""

from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.typed import NonNegative, Positive, Share


@dataclass(frozen=True, kw_only=True)
class FrictionSettings:
    """Magnitudes of friction and ripple; zero switches a part off."""

    # range of the Coulomb friction, as a share of the joint's torque
    coulomb: tuple[Share, Share] = (0.05, 0.2)
    # range of the viscous friction at top speed, relative to Coulomb friction
    viscous: tuple[NonNegative, NonNegative] = (0.3, 1.0)
    width: Positive = 0.03  # speed [rad/s] at which the smooth sign is at 76 %
    stribeck: NonNegative = 0.4  # extra friction near rest, relative to Coulomb friction
    load: NonNegative = 0.05  # friction per transmitted torque
    asymmetry: Share = 0.15  # half the difference between directions, relative to Coulomb friction
    position: Share = 0.15  # position-dependent friction, relative to Coulomb friction
    ripple: NonNegative = 0.01  # relative to the joint's torque


@dataclass(frozen=True, kw_only=True)
class Law:
    """Friction law of a plant's joints; every vector is (J,).

    Hess and Soom's curve near rest, Eyring's shear-thinning lubricant, saturating load dependence.

    Source: Hess, Soom 1990; Olsson et al. 1998.
    """

    settings: FrictionSettings
    scale: Array  # torque of the joints [N·m or N]
    coulomb: Array  # [N·m or N]
    viscous: Array  # [N·m·s/rad]
    speed: Array  # scale of the curve near rest [rad/s]
    phase: Array  # (3, J)
    skew: Array  # asymmetry between directions, −1 … 1

    @classmethod
    def drawn(
        cls, settings: FrictionSettings, scale: Array, top: Array, random: np.random.Generator
    ) -> "Law":
        """A random friction law for joints with these torque scales and top speeds."""
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
        """Friction against the motion [N·m or N], (…, J), with transmitted torques ``load``."""
        s = np.tanh(dq / self.settings.width)
        size = self.settings
        share = load / self.scale
        rest = 1 / (1 + (dq / self.speed) ** 2)
        thin = 6 * self.speed
        loaded = load**2 / (np.abs(load) + 0.5 * self.scale) * (1 + 0.3 * s * np.tanh(share))
        place = 0.6 * np.cos(q + self.phase[0]) + 0.4 * np.cos(3 * q + self.phase[1])
        wave = np.sin(54 * q + self.phase[2]) * (1 + 0.5 * share)
        level = 1 + size.stribeck * rest + size.asymmetry * self.skew * s + size.position * place
        friction = s * (self.coulomb * level + size.load * loaded)
        return friction + self.viscous * thin * np.arcsinh(dq / thin) + size.ripple * self.scale * wave
