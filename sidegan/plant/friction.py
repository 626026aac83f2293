"""Nonlinear friction and torque ripple, which identified models lack.

The law differs in form from the smooth basis with which ``identification.residuals`` explains residuals.
"""

from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.typed import NonNegative, Positive, Share
from sidegan.kernels.friction import Law


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


def drawn(settings: FrictionSettings, scale: Array, top: Array, random: np.random.Generator) -> Law:
    """A random friction law for joints with these torque scales and top speeds, (J,) each."""
    joints = len(scale)
    coulomb = scale * random.uniform(*settings.coulomb, joints)
    viscous = coulomb / top * random.uniform(*settings.viscous, joints)
    speed = random.uniform(0.02, 0.08, joints) * top
    phases = random.uniform(0, 2 * np.pi, (3, joints))
    return Law(
        scale=scale,
        coulomb=coulomb,
        viscous=viscous,
        width=np.full(joints, settings.width),
        speed=speed,
        stribeck=settings.stribeck * coulomb,
        skew=settings.asymmetry * coulomb * random.uniform(-1, 1, joints),
        place=settings.position * coulomb,
        load=np.full(joints, settings.load),
        ripple=settings.ripple * scale,
        phases=phases,
    )
