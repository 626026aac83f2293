"""What motions cost that come near their limits."""

from typing import NamedTuple

import numpy as np

from sidegan.kernels.chain import Array, Shapes


class Limits(NamedTuple):
    """Limits of J joints.

    A position, a velocity or a torque costs weight times the square of how far it exceeds the limit less
    the reserve, as a share of the limit.
    """

    weight: float  # of all costs
    reserve: float  # share of position and velocity limits that is kept free
    torque_reserve: float  # the same of torque limits
    middle: Array  # of the positions [rad or m], (J,)
    room: Array  # to both sides of it [rad or m], (J,)
    speed: Array  # largest [rad/s or m/s], (J,)
    torque: Array  # largest [N·m or N], (J,); infinite where it does not matter
    parameters: Array  # that torques follow from, (10 J,)

    @classmethod
    def none(cls, joints: int) -> "Limits":
        """Limits that cost nothing."""
        ones = np.ones(joints)
        return cls(0.0, 0.0, 0.0, ones, ones, ones, ones, np.ones(10 * joints))


class Near(NamedTuple):
    """Distances that are kept: weight times the square of what a distance lacks."""

    weight: float  # of the squares [1/m²]
    reach: float  # smallest distance that costs nothing [m]
    shapes: Shapes  # capsules and regions
