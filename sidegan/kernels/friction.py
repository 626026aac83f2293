"""A plant's friction law, for one joint at one time or for arrays; kernels inline it."""

from typing import NamedTuple

import numpy as np

from sidegan.base.arrays import Array
from sidegan.kernels.formulas import Scalar


class Law(NamedTuple):
    """Parameters of a friction law; every vector is (J,)."""

    scale: Array  # torque of the joints [N·m or N]
    coulomb: Array  # [N·m or N]
    viscous: Array  # [N·m·s/rad]
    width: Array  # speed at which the smooth sign is at 76 % [rad/s]
    speed: Array  # scale of the curve near rest [rad/s]
    stribeck: Array  # further friction near rest [N·m or N]
    skew: Array  # difference between directions [N·m or N]
    place: Array  # amplitude of position-dependent friction [N·m or N]
    load: Array  # friction per transmitted torque
    ripple: Array  # amplitude of the ripple [N·m or N]
    phases: Array  # of position-dependent friction and ripple, (3, J)


def friction_torque(q: Scalar, dq: Scalar, load: Scalar, law: Law, j: int | slice) -> Scalar:
    """Friction of joint j, or of several, against the motion [N·m or N] with transmitted torques.

    Hess and Soom's curve near rest, Eyring's shear-thinning lubricant, saturating load dependence.

    Source: Hess, Soom 1990; Olsson et al. 1998.
    """
    scale = law.scale[j]
    sign = np.tanh(dq / law.width[j])
    near_rest = 1 / (1 + (dq / law.speed[j]) ** 2)
    place = 0.6 * np.cos(q + law.phases[0, j]) + 0.4 * np.cos(3 * q + law.phases[1, j])
    level = law.coulomb[j] + law.stribeck[j] * near_rest + law.skew[j] * sign + law.place[j] * place
    loaded = load**2 / (np.abs(load) + 0.5 * scale) * (1 + 0.3 * sign * np.tanh(load / scale))
    thin = 6 * law.speed[j]
    viscous = law.viscous[j] * thin * np.arcsinh(dq / thin)
    ripple = law.ripple[j] * np.sin(54 * q + law.phases[2, j]) * (1 + 0.5 * load / scale)
    return sign * (level + law.load[j] * loaded) + viscous + ripple
