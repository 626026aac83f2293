"""Friction and ripple that no linear model has, in two families, and what of them a model can have.

The laws differ in form between the families, and from the smooth basis that ``identification.lacking`` weighs
motions by, so that no motion is judged with what it was designed for.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sidegan.base.typed import NonNegative, Positive, Share

Array = NDArray[np.float64]
Form = Literal["linear", "eyring", "tustin"]

_FINE = 1e-6  # [rad/s] that keeps powers of the speed finite at rest


@dataclass(frozen=True)
class FrictionSettings:
    """Sizes; a size of zero switches its part off."""

    coulomb: tuple[Share, Share]  # range of the Coulomb friction, as a share of the joint's torque
    viscous: tuple[NonNegative, NonNegative]  # range of the viscous friction at top speed, of Coulomb's
    width: Positive  # speed [rad/s] at which the smooth sign is at 76 %
    stribeck: NonNegative  # extra friction near rest, of Coulomb's
    load: NonNegative  # friction per transmitted torque
    asymmetry: Share  # half the difference between the directions, of Coulomb's
    position: Share  # friction that changes with the joint's position, of Coulomb's
    ripple: NonNegative  # of the joint's torque


@dataclass(frozen=True)
class Law:
    """Friction of the joints of one plant; every vector is (J,).

    The form is ``linear`` (Coulomb and viscous alone, which a model has), ``eyring`` (Hess and Soom's curve
    near rest, shear-thinning lubricant, saturating load dependence) or ``tustin`` (an exponential of the root
    of the speed, a power law, a load dependence that grows faster than the load).

    Source: Hess, Soom 1990; Bo, Pavelescu 1982; Olsson et al. 1998 (all forms).
    """

    form: Form
    settings: FrictionSettings
    scale: Array  # torque of the joints [N·m or N]
    coulomb: Array  # [N·m or N]
    viscous: Array  # [N·m·s/rad]
    speed: Array  # of the curve near rest [rad/s]
    phase: Array  # (3, J)
    skew: Array  # −1 … 1, how much the directions differ

    @classmethod
    def drawn(
        cls, form: Form, settings: FrictionSettings, scale: Array, top: Array, random: np.random.Generator
    ) -> "Law":
        """Friction of one plant whose joints have a torque of this scale and a top speed."""
        joints = len(scale)
        coulomb = scale * random.uniform(*settings.coulomb, joints)
        viscous = coulomb / top * random.uniform(*settings.viscous, joints)
        speed = random.uniform(0.02, 0.08, joints) * top
        phase, skew = random.uniform(0, 2 * np.pi, (3, joints)), random.uniform(-1, 1, joints)
        return cls(form, settings, scale, coulomb, viscous, speed, phase, skew)

    def linear(self, dq: Array) -> Array:
        """The part that is linear in its parameters, (…, J)."""
        return self.coulomb * np.tanh(dq / self.settings.width) + self.viscous * dq

    def __call__(self, q: Array, dq: Array, load: Array) -> Array:
        """Friction [N·m or N] against the motion, (…, J), with transmitted torques ``load``."""
        if self.form == "linear":
            return self.linear(dq)
        s, size = np.tanh(dq / self.settings.width), self.settings
        part = self._eyring if self.form == "eyring" else self._tustin
        rest, lubricant, loaded, place, wave = part(q, dq, load, s)
        level = 1 + size.stribeck * rest + size.asymmetry * self.skew * s + size.position * place
        friction = s * (self.coulomb * level + size.load * loaded) + self.viscous * lubricant
        return friction + size.ripple * self.scale * wave

    def _eyring(self, q: Array, dq: Array, load: Array, s: Array) -> tuple[Array, ...]:
        rest = 1 / (1 + (dq / self.speed) ** 2)
        thin = 6 * self.speed
        lubricant = thin * np.arcsinh(dq / thin)
        loaded = load**2 / (np.abs(load) + 0.5 * self.scale) * (1 + 0.3 * s * np.tanh(load / self.scale))
        place = 0.6 * np.cos(q + self.phase[0]) + 0.4 * np.cos(3 * q + self.phase[1])
        return rest, lubricant, loaded, place, np.sin(54 * q + self.phase[2]) * (1 + 0.5 * load / self.scale)

    def _tustin(self, q: Array, dq: Array, load: Array, s: Array) -> tuple[Array, ...]:
        speed = np.abs(dq) + _FINE
        rest = np.exp(-np.sqrt(speed / self.speed))
        lubricant = np.sign(dq) * (6 * self.speed) ** (1 / 3) * speed ** (2 / 3)
        loaded = np.abs(load) ** 1.5 / np.sqrt(self.scale)
        wave = np.sin(q + self.phase[0])
        return rest, lubricant, loaded, wave * np.abs(wave), np.tanh(3 * np.sin(81 * q + self.phase[1]))
